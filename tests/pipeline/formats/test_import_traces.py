"""Traces of others: what is laid out as a file says is the scan again, and what cannot be is said with its place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.maps import TraceDirection
from pipeline.formats.import_traces import import_traces
from pipeline.formats.traces_file import TracesFile, read_traces_file
from tests.factories import scanned
from tests.support.scans import ROUGH_PLAN, rough_plate
from whisker_array.scan.scan import Scan
from whisker_array.scan.stagger import to_instants
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.touch import default_touch

TOUCH = default_touch(5.0)
COLUMNS = {"moment": ["a", "b", "c"], "x": "x", "y": "y", "time": "t", "lifted": "up", "pass": "n"}
ACROSS = [0.0, 0.5, 1.0]


def told(**more: Any) -> TracesFile:
    columns = {**COLUMNS, **more.pop("columns", {})}
    keys = {"whisker": "w.toml", "columns": columns, "across_mm": ACROSS, "lead_mm": 0.7, **more}
    return TracesFile.model_validate(keys)


@pytest.fixture(scope="module")
def scan() -> Scan:
    ways = (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y, TraceDirection.BACK_X)
    plan = replace(ROUGH_PLAN, region_mm=(0.5, 0.5, 6.0, 1.9), directions=ways)
    return scanned(rough_plate(np.random.default_rng(3)), plan, touch=TOUCH)


def rows_of(scan: Scan, *, behind: tuple[int, ...] = (0, 0, 0)) -> dict[str, np.ndarray]:
    """What a bench would have logged."""
    parts: dict[str, list[np.ndarray]] = {name: [] for name in ("x", "y", "up", "n", "a", "b", "c")}
    number = 0
    for sweep in scan.sweeps:
        n_air = sweep.air_n_mm.shape[2]
        taken = to_instants(sweep.moment_n_mm, np.array(behind))
        sign = -1.0 if sweep.plan.direction.backward else 1.0
        along = sweep.plan.start_mm + sign * sweep.plan.step_mm * np.arange(taken.shape[2])
        along = np.r_[np.full(n_air, along[0]), along]
        for line, air, moment in zip(sweep.plan.line_mm, sweep.air_n_mm, taken, strict=True):
            pair = (along, np.full(along.size, line[0]))
            x, y = pair if sweep.plan.direction.along_x else pair[::-1]
            up = (np.arange(along.size) < n_air).astype(float)
            logged = np.concatenate([air, moment], axis=1).astype(np.float64)
            for name, values in zip(parts, (x, y, up, np.full(x.size, number), *logged), strict=True):
                parts[name].append(values)
            number += 1
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    return {**columns, "t": np.arange(columns["x"].size) / scan.sample_rate_hz}


def write_csv(
    path: Path, columns: dict[str, np.ndarray], *, delimiter: str = ",", header: bool = True
) -> Path:
    names = delimiter.join(columns)
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, fmt="%.9g", delimiter=delimiter, header=names if header else "", comments="")
    return path


def assert_like(read: Scan, scan: Scan) -> None:
    """Sample by sample; nine digits of text leave 1e-6 of a position, and so of a moment."""
    assert read.directions == tuple(sorted(scan.directions, key=int))
    for sweep in scan.sweeps:
        (other,) = (s for s in read.sweeps if s.plan.direction is sweep.plan.direction)
        assert other.plan.n_lead == sweep.plan.n_lead
        assert other.plan.n_samples == sweep.plan.n_samples
        assert other.plan.start_mm == pytest.approx(sweep.plan.start_mm, abs=1e-6)
        assert other.plan.step_mm == pytest.approx(sweep.plan.step_mm, rel=1e-5)
        np.testing.assert_allclose(other.plan.line_mm, sweep.plan.line_mm, atol=1e-6)
        np.testing.assert_allclose(other.moment_n_mm, sweep.moment_n_mm, atol=1e-4)
        np.testing.assert_allclose(other.air_n_mm, sweep.air_n_mm, atol=1e-6)


def test_what_is_written_as_text_is_the_scan_again(scan: Scan, tmp_path: Path) -> None:
    read = import_traces([write_csv(tmp_path / "t.csv", rows_of(scan))], told(), touch=TOUCH)
    assert_like(read, scan)
    assert read.sample_rate_hz == pytest.approx(scan.sample_rate_hz, rel=1e-6)
    assert read.line_pitch_mm == pytest.approx(scan.line_pitch_mm, abs=1e-6)
    assert not any(s.flags.any() for s in read.sweeps)


def test_units_numbered_columns_and_other_text_are_taken_as_told(scan: Scan, tmp_path: Path) -> None:
    rows = rows_of(scan)
    metres = {k: v / 1000.0 if k in ("x", "y", "a", "b", "c") else v for k, v in rows.items()}
    path = write_csv(tmp_path / "t.txt", metres, delimiter=";", header=False)
    path.write_text("written by a bench\n" + path.read_text().replace(".", ","))
    order = list(rows)
    columns = {
        k: [order.index(c) + 1 for c in v] if k == "moment" else order.index(v) + 1
        for k, v in COLUMNS.items()
    }
    how = {"delimiter": ";", "decimal": ",", "skip_lines": 1}
    layout = told(columns=columns, csv=how, position_unit="m", moment_unit="N*m")
    assert_like(import_traces([path], layout, touch=TOUCH), scan)


def test_files_of_one_pass_each_and_samples_that_stand_still(scan: Scan, tmp_path: Path) -> None:
    rows, files = rows_of(scan), []
    for k in range(int(rows["n"].max()) + 1):
        columns = {name: values[rows["n"] == k] for name, values in rows.items() if name not in ("n", "t")}
        # the stage stands before it starts, and when it has stopped
        columns = {name: np.r_[values[:6], values[5:], values[-1:]] for name, values in columns.items()}
        files.append(write_csv(tmp_path / f"{k}.csv", columns))
    layout = told(columns={"pass": None, "time": None}, sampling_rate_hz=500.0)
    read = import_traces(files, layout, touch=TOUCH)
    assert_like(read, scan)
    assert read.sample_rate_hz == 500.0


def test_an_uneven_stage_is_laid_even_and_what_it_skipped_is_missing(scan: Scan, tmp_path: Path) -> None:
    rows = rows_of(scan)
    x = rows["x"]
    smooth = {**rows, "a": np.sin(x), "b": np.sin(2.0 * x), "c": np.cos(x)}
    keep = np.ones(x.size, dtype=bool)
    keep[20:23] = False  # three samples of the first pass were lost
    keep[60::7] = False  # and single ones of all
    read = import_traces(
        [write_csv(tmp_path / "t.csv", {k: v[keep] for k, v in smooth.items()})], told(), touch=TOUCH
    )
    sweep = next(s for s in read.sweeps if s.plan.direction is TraceDirection.FORWARD_X)
    good = sweep.flags == 0
    truth = np.sin(sweep.plan.position_mm())
    # straight lines over 0.2 mm of a sine miss it by 0.2^2 / 8
    assert np.abs(sweep.moment_n_mm[:, 0] - truth)[good[:, 0]].max() < 0.0055
    assert (sweep.flags[0] == SampleFlag.DROPOUT).all(axis=0).sum() in (3, 4)
    assert good[1:].all()


def test_rows_of_whiskers_are_each_laid_where_their_tip_was(scan: Scan, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "t.csv", rows_of(scan, behind=(0, 4, 4)))
    read = import_traces([path], told(behind_mm=[0.0, 0.4, 0.4]), touch=TOUCH)
    assert_like(read, scan)
    assert read.sweeps[0].plan.offset_mm == pytest.approx((0.0, 0.4, 0.4), rel=1e-4)


def test_a_comb_that_turns_and_a_part_that_ends(scan: Scan, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "t.csv", rows_of(scan))
    read = import_traces([path], told(turns=True, part_mm=[0.0, 0.0, 5.0, 1.6]), touch=TOUCH)
    by_way = {int(s.plan.direction): s for s in read.sweeps}
    assert by_way[0].plan.line_mm[0, 2] - by_way[0].plan.line_mm[0, 0] == pytest.approx(1.0)
    for way in (90, 180):
        assert by_way[way].plan.line_mm[0, 2] - by_way[way].plan.line_mm[0, 0] == pytest.approx(-1.0)
    for sweep in read.sweeps:
        line = np.broadcast_to(sweep.plan.line_mm[:, :, None], sweep.flags.shape)
        along = np.broadcast_to(sweep.plan.position_mm(), sweep.flags.shape)
        x, y = (along, line) if sweep.plan.direction.along_x else (line, along)
        on = (x >= 0.0) & (x <= 5.0) & (y >= 0.0) & (y <= 1.6)
        np.testing.assert_array_equal(sweep.flags == 0, on)


def test_tdms_is_the_scan_again_and_its_damage_is_said(scan: Scan, tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    rows, path = rows_of(scan), tmp_path / "t.tdms"
    increment = {"wf_increment": 1.0 / scan.sample_rate_hz}

    def write(columns: dict[str, np.ndarray]) -> None:
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("bench", k, v, increment) for k, v in columns.items()])

    write(rows)
    layout = told(columns={"time": None, "moment": ["a", "bench/b", "c"]})
    read = import_traces([path], layout, touch=TOUCH)
    assert_like(read, scan)
    assert read.sample_rate_hz == pytest.approx(scan.sample_rate_hz, rel=1e-9)
    write({**rows, "b": rows["b"][:-3]})
    with pytest.raises(FileError, match=r"t\.tdms: has [\d,]+ samples in channel 'bench/b' and"):
        import_traces([path], layout, touch=TOUCH)
    write({k: v for k, v in rows.items() if k != "c"})
    with pytest.raises(FileError, match=r"t\.tdms: has no channel 'c' \(it has bench/x"):
        import_traces([path], layout, touch=TOUCH)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FileError, match=r"t\.tdms: "):
        import_traces([path], layout, touch=TOUCH)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("speed = 3", "has the unknown key speed; take it out"),
        ("position_unit = 'yard'", "says position_unit = 'yard'"),
        ("moment_unit = 'mV'", "write 'N*mm', 'mN*m', 'N*m' or 'V'"),
        ("across_mm = [0.0]", "has 1 numbers in across_mm, and 2 whiskers"),
        ("behind_mm = [1.0, 2.0]", "has no whisker with 0 in behind_mm"),
        ("part_mm = [1.0, 0.0, 0.5, 2.0]", "has part_mm"),
        ("format_version = 2", "has format version 2; this program reads 1"),
        ("lead_mm = inf", "says lead_mm = inf"),
        ("lead_mm = ", "is not TOML"),
    ],
)
def test_a_wrong_key_is_named(tmp_path: Path, more: str, says: str) -> None:
    path = tmp_path / "traces.toml"
    across = "" if more.startswith("across") else "across_mm = [0.0, 1.0]\n"
    path.write_text(f"{more}\n{across}whisker = 'w.toml'\n[columns]\nmoment = ['a', 'b']\nx = 'x'\ny = 'y'\n")
    with pytest.raises(FileError) as failure:
        read_traces_file(path)
    assert f"{path}: " in str(failure.value)
    assert says in str(failure.value)
