"""Touch reads by templates alone: the line found by their answers, and no network opened."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from glyphs.surface.maps import TraceDirection
from recognition.decide.decision import Decision
from recognition.find.template_lines import TemplateSearch
from recognition.language.grammar import Grammar
from recognition.reader import Reader
from recognition.recogniser import networks
from recognition.recogniser.read_line import ReadLine
from recognition.see.levelling import level
from recognition.see.text_line import TextLine
from recognition.settings import ReaderSettings
from tests.support.felt import felt
from whisker_array.whisker.touch import Touch, default_touch

READERS: dict[ReaderSettings, Reader] = {}


@pytest.fixture(autouse=True)
def _no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(*_: object) -> None:
        raise AssertionError("a network was opened")

    for module in ("find.finder", "recogniser.recogniser"):
        monkeypatch.setattr(f"recognition.{module}._session", opened)
    monkeypatch.setattr(networks, "open_network", opened)


def reader(**changed: object) -> Reader:
    few = Grammar(sets=("KTRB", "7832"))  # of few characters, which take few templates
    options = {"fonts": ("gothic",), "format": few, "height_mm": 4.0, "orientation": "upright", **changed}
    settings = ReaderSettings(experts=("templates",), **options)  # type: ignore[arg-type]
    return READERS.setdefault(settings, Reader(settings))


@cache
def plate(text: str = "K7", **options: Any) -> HeightMap:
    return stamp(text, **{"fonts": "gothic", "height_mm": 4.0, "seed": 1, **options}).height_map


def test_a_clean_part_is_read_and_accepted_at_the_height_that_is_known() -> None:
    reading = reader(format="AA99").read(plate("KX47"))
    assert (reading.text, reading.decision) == ("KX47", Decision.ACCEPT)
    assert [*reading.trace.by_expert] == ["templates"]
    assert [c.depth is not None for c in reading.characters] == [True] * 4


def test_the_height_is_found_where_nobody_knows_it() -> None:
    reading = reader(height_mm=None).read(plate("T8", height_mm=6.0))
    assert reading.text == "T8"
    assert reading.height_mm == pytest.approx(6.0, rel=0.07)


def test_a_line_that_is_turned_a_little_is_read() -> None:
    reading = reader(format="AA9").read(plate("NR2", line_rotation_deg=-4.0, practice="ideal"))
    assert reading.text == "NR2"
    assert reading.rotation_deg == pytest.approx(-4.0, abs=1.0)


def test_raised_marks_are_read() -> None:
    reading = reader().read(HeightMap(-plate().z_mm, plate().pitch_mm))
    assert (reading.text, reading.raised) == ("K7", True)


def test_a_part_that_lies_upside_down_is_read_where_that_may_be() -> None:
    part = plate("KF4", seed=5)
    turned = HeightMap(np.ascontiguousarray(part.z_mm[::-1, ::-1]), part.pitch_mm)
    assert reader(format="AA9", orientation="any").read(turned).text == "KF4"


def test_a_scan_of_two_directions_is_read() -> None:
    scan = felt(level(plate()), 4.0, directions=(TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y))
    assert reader().read(scan).text == "K7"


def test_without_a_format_all_characters_are_read() -> None:
    assert reader(format=None).read(plate("7EH2", seed=6)).text == "7EH2"


def test_what_the_format_does_not_allow_is_not_accepted() -> None:
    assert reader().read(plate("K713", seed=7)).decision is not Decision.ACCEPT


def test_a_bare_plate_is_no_serial() -> None:
    noise = np.random.default_rng(8).normal(scale=0.002, size=(60, 120)).astype(np.float32)
    reading = reader().read(HeightMap(noise, 0.1))
    assert (reading.text, reading.decision) == ("", Decision.REJECT)


def test_another_orientation_is_judged_with_the_whisker_that_felt_the_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    surface = level(plate("25"))
    touch = replace(default_touch(4.0), preload_mm=0.6)
    scan = felt(surface, 4.0, touch=touch)
    turned: list[Touch | None] = []
    read = TemplateSearch.read

    def watched(search: TemplateSearch, lines: Iterable[TextLine]) -> list[ReadLine]:
        turned.append(search.view.touch)
        return read(search, lines)

    monkeypatch.setattr(TemplateSearch, "read", watched)
    reading = reader(format="99", orientation="any").read(scan)
    assert reading.text == "25"
    assert reading.evidence.touch.lines.main.other_ways
    assert set(turned) == {touch}
