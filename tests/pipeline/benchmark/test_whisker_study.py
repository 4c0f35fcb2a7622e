"""The study of whiskers: its cells are what they say, rows are kept, and the page has the tables of the kept rows."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recognition.see.virtual_array import VirtualArray
from tests.benchmarks.whisker_study import (
    BY_CORRELATION,
    CELLS,
    ROWS,
    SPEED_CELLS,
    SPEED_ROWS,
    Cell,
    CellArray,
    Readings,
    Row,
    StudyPart,
    add_part,
    load_parts,
    report,
    speed_tables,
)
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.ringing import ringing_of

PAGE = Path(__file__).parents[3] / "docs" / "pages" / "results-whisker.md"
HEIGHTS_MM = (3.5, 5.0, 8.0)


def cell_named(name: str) -> Cell:
    (cell,) = (cell for cell in CELLS if cell.name == name)
    return cell


def row(text: str, score: float, *, edits: int = 0, accepted: bool = False, broken: bool = False) -> Row:
    return Row("default", "reader", text, edits, score, accepted, broken)


def test_the_page_has_the_tables_of_the_kept_rows() -> None:
    page = PAGE.read_text(encoding="utf-8").splitlines()
    tables = (*report(load_parts()), *speed_tables(load_parts(SPEED_ROWS)))
    missing = [line for line in tables if line.startswith(("|", "Mean")) and line not in page]
    assert not missing


@pytest.mark.parametrize(("path", "cells"), [(ROWS, CELLS), (SPEED_ROWS, SPEED_CELLS)])
def test_every_part_has_a_row_for_every_cell(path: Path, cells: tuple[Cell, ...]) -> None:
    for part in load_parts(path):
        assert [row.cell for row in part.rows if row.by == "reader"] == [cell.name for cell in cells]


def test_whiskers_ring_in_the_cells_of_speed_alone() -> None:
    for cell in (*CELLS, *SPEED_CELLS):
        ringing = CellArray(cell=cell).touch(5.0).ringing
        assert (ringing is None) == (cell.factor != "speed")
        if ringing is not None:
            assert ringing.held_hz == pytest.approx(ringing_of(cell.whisker(5.0)).held_hz / cell.speed)


@pytest.mark.parametrize("height_mm", HEIGHTS_MM)
def test_longer_feet_leave_the_sensor_the_room_that_the_default_leaves(height_mm: float) -> None:
    for name in ("default", "l2 6", "l2 9"):
        cell = cell_named(name)
        whisker, preload_mm = cell.whisker(height_mm), CellArray(cell=cell).touch(height_mm).preload_mm
        room_mm = whisker.l2_mm - preload_mm - whisker.lowered_mm
        assert room_mm == pytest.approx(max(1.5, 0.3 * height_mm))


@pytest.mark.parametrize("height_mm", HEIGHTS_MM)
def test_only_straight_whiskers_and_profilers_do_not_enhance(height_mm: float) -> None:
    for cell in BY_CORRELATION:
        touch = CellArray(cell=cell).touch(height_mm)
        falling, rising = moment_ratio([-math.sqrt(3.0), math.sqrt(3.0)], 0.2, touch.tip)
        if cell.name in ("straight", "profiler"):
            assert (falling, rising) == pytest.approx((1.0, 1.0), abs=0.001)
        else:
            assert falling > 1.05
            assert rising < 0.95


def test_noise_of_a_cell_is_that_of_the_usual_sensors_multiplied() -> None:
    plan = default_plan((0.0, 0.0, 20.0, 8.0), character_height_mm=5.0)
    touch = VirtualArray().touch(5.0)
    usual = VirtualArray().draw(plan, touch)["sensor"]
    loud = CellArray(cell=cell_named("noise 10")).draw(plan, touch)["sensor"]
    assert usual is not None
    assert loud is not None
    assert loud.noise_n_mm == pytest.approx(10.0 * usual.noise_n_mm)
    assert np.array_equal(loud.gain, usual.gain)


def test_rows_are_added_and_loaded(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl.gz"
    jammed = replace(row("", 0.0, edits=8), error="the whisker jams", flags=("JAMMED",))
    parts = [
        StudyPart(k, "AB123456", {"severity": 0.3}, "a1", (row("AB123456", 0.99), jammed)) for k in (7, 2)
    ]
    for part in parts:
        add_part(part, path)
    assert load_parts(path) == parts[::-1]


def test_parts_accepted_before_the_first_wrong_one() -> None:
    rows = (
        row("AB123456", 0.99), row("AB123456", 0.9), row("AB123450", 0.95, edits=1),
        row("AB123456", 0.98, broken=True), row("AB123450", 0.995, edits=1, broken=True),
    )  # fmt: skip
    assert Readings(rows, ("AB123456",) * len(rows)).before_first_wrong == 1
