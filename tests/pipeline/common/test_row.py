"""Rows of tables, and keys of what answers depend on."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from pipeline.common.reading_records import (
    CandidateRecord,
    CharacterRecord,
    LineRecord,
    ReadingRecord,
    RivalRecord,
)
from pipeline.common.row import _ACTIONS, row_of
from pipeline.common.version import differences, key_of
from recognition.marks.grade import Action


def row(*places: CharacterRecord, source: str = "tactile", **more: Any) -> SimpleNamespace:
    return SimpleNamespace(**row_of(ReadingRecord(source, "AB", "review", 0.5, places, part="p", **more)))


def place(*candidates: tuple[str, float], **more: Any) -> CharacterRecord:
    options = tuple(CandidateRecord(c, p) for c, p in candidates or (("A", 0.9),))
    return CharacterRecord(options, (0.0, 0.0, 1.0, 1.0), **more)


def test_states_name_the_places_that_are_not_plainly_read() -> None:
    cells = row(
        place(state="read"),
        place(state="confused", state_chars=("8", "B")),
        place(state="not read"),
        place(state="mismatch", state_chars=("8", "")),
        place(),
    )
    assert cells.states == "2:confused 8/B, 3:not read, 4:mismatch 8/-"
    assert row().states == ""


def test_alternatives_have_some_belief() -> None:
    assert row(place(("8", 0.7), ("B", 0.2), ("S", 0.001)), place()).alternatives == "1: B 0.20"


def test_grades_and_the_worst() -> None:
    cells = row(*(place(grade=g) for g in ("A", "C", "", "B", "?")))
    assert (cells.grades, cells.grade) == ("AC?B?", "C")
    ungraded = row(place())
    assert (ungraded.grades, ungraded.grade, ungraded.action) == ("", "", "")
    assert row(place(grade="?")).grade == "?"


def test_actions_name_their_places() -> None:
    cells = row(*(place(action=a) for a in ("re-strike", "clean", "", "clean")))
    assert cells.action == "clean 2 4, re-strike 1"
    assert tuple(a.value for a in Action if a is not Action.NONE) == _ACTIONS


def test_depths_are_of_touch() -> None:
    cells = row(place(), place(("B", 0.9), depth_min_mm=0.10004, depth_mean_mm=0.2))
    assert (cells.depths, cells.depth_min_mm, cells.depth_mean_mm) == ("A ? B 0.100/0.200", 0.1, 0.2)
    assert row(place(), source="vision").depths == ""


def test_a_height_is_in_mm_or_in_pixels() -> None:
    assert (row(height_mm=5.00004).height_mm, row(height_mm=5.0).height_px) == (5.0, None)
    cells = row(height_px=399.57)
    assert (cells.height_mm, cells.height_px) == (None, 399.6)


def test_rivals_stand_with_their_probability() -> None:
    assert row(rivals=(RivalRecord("KB", 0.0214), RivalRecord("KX", 0.01))).rivals == "KB 0.021, KX 0.010"


def test_other_lines_stand_by_name() -> None:
    lines = (LineRecord("lot", "LOT77", 0.99), LineRecord("date", "12/26", 0.5), LineRecord("", "SN8", 0.9))
    assert row(lines=lines).lines == "lot=LOT77;date=12/26;SN8"
    assert row().lines == ""


def test_the_order_of_entries_does_not_matter() -> None:
    assert key_of({"a": 1, "b": [2]}) == key_of({"b": [2], "a": 1}) != key_of({"a": 1, "b": [3]})


def test_what_differs_is_told_in_short() -> None:
    was = {"same": 1, "gone": True, "long": "x" * 99}
    told = differences(was, {"same": 1, "new": [1, 2], "long": "y"})
    assert told == f'gone was true, now not set; long was "{"x" * 56}..., now "y"; new was not set, now 1, 2'
    one, other = ({"a": {"b": b, "long": "x" * 99}} for b in (1, 2))
    assert differences(one, other) == "a.b was 1, now 2"
    told = differences({"settings": {}}, {"settings": {"format": ["A9", "vin"]}})
    assert told == "format was not set, now A9, vin"
    assert differences({"a": [1, 2]}, {"a": (1, 2)}) == ""  # as JSON has it
