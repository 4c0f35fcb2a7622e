"""A reading weighed against the other ways in which its marks may be meant."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from glyphs import stamp
from glyphs.surface.maps import HeightMap
from recognition.decide import risk
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.evidence import Evidence, SenseEvidence
from recognition.decide.reading import Reading
from recognition.find import other_ways as room
from recognition.find.other_ways import OtherWay, other_ways, ways_possible
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation, Way
from recognition.language.remainders import ALPHANUMERIC
from recognition.search.line_reader import LineReader
from recognition.search.line_search import LineSearch
from recognition.search.part_lines import PartLines
from recognition.settings import ReaderSettings
from recognition.views.levelling import level
from recognition.views.view import View, heights_view
from tests.support.evidence import believed_line


def view_of(text: str, *, mirrored: bool = False) -> View:
    surface = level(stamp(text, fonts="gothic", height_mm=4.0, seed=3).height_map)
    return heights_view(surface.mirrored if mirrored else surface)


def read(view: View, mask: str) -> tuple[PartLines, LineReader]:
    lines = LineReader(LineSearch(Grammar(format=mask), ALPHANUMERIC, height_mm=4.0))
    return lines.read(view), lines


def reading_of(part: PartLines, ways: tuple[OtherWay, ...], mask: str) -> Reading:
    evidence = Evidence.of(SenseEvidence("tactile", lines=part, other_ways=ways))
    return decide(evidence, ReaderSettings(format=mask))


@pytest.mark.parametrize(
    ("orientation", "rows_known", "turned_deg", "ways"),
    [
        (Orientation.ANY, True, 0.0, (Way.UPSIDE_DOWN,)),
        (Orientation.UPRIGHT, True, 0.0, ()),
        (Orientation.UPRIGHT, True, -88.0, (Way.UPSIDE_DOWN,)),
        (Orientation.UPRIGHT, False, 0.0, (Way.ROWS_REVERSED,)),
        (Orientation.ANY, False, 0.0, tuple(Way)),
    ],
)
def test_what_is_known_removes_ways(
    orientation: Orientation, rows_known: bool, turned_deg: float, ways: tuple[Way, ...]
) -> None:
    assert ways_possible(orientation, rows_known=rows_known, turned_deg=turned_deg) == ways


def test_a_text_that_the_marks_also_show_mirrored_goes_to_review(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of these marks a look tells the way; the test has it tell too little."""
    monkeypatch.setattr(room, "LEAST_LEAD_NATS", math.inf)
    view = view_of("822800")
    part, lines = read(view, "999999")
    found = reading_of(part, other_ways(part, view, lines, rows_known=False), "999999")
    assert (found.text, found.decision) == ("822800", Decision.REVIEW)
    assert any("also readable with its rows in the other order: " in m for m in found.messages())


def test_what_a_look_settles_is_no_doubt() -> None:
    view = view_of("471275")
    part, lines = read(view, "999999")
    assert other_ways(part, view, lines) == ()


@pytest.mark.parametrize(
    ("text", "reverse", "doubted"),
    [
        ("LOT47", False, False),
        ("LOT47", True, True),  # it says that the part lies upside down
        ("HOXN", False, True),  # reads upside down as well
    ],
)
def test_another_line_that_reads_one_way_settles_it(
    text: str, reverse: bool, doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(risk, "threshold_of", lambda source, allowed: 0.97)
    view, beside = view_of("9608"), view_of(text)
    part, lines = read(view, "9999")
    line = LineReader(LineSearch(None, ALPHANUMERIC, height_mm=4.0)).read(beside).main
    assert line is not None
    # both lines stand on one part: the view of the other is below that of the serial
    both = replace(view, layers=stacked(view, beside))
    down = np.array((0.0, view.layers.shape[1] * view.pitch_mm))
    place = replace(line.line, centre_mm=line.line.centre_mm + down)
    other = replace(line, line=place.reversed if reverse else place)
    part = replace(part, others=(other,))
    found = reading_of(part, other_ways(part, both, lines), "9999")
    assert found.others[0].text == text
    assert bool(found.flags & ReadingFlag.ORIENTATION_UNKNOWN) == doubted


def test_a_doubtful_line_settles_nothing() -> None:
    view = view_of("9608")
    part, lines = read(view, "9999")
    assert part.main is not None
    doubtful = believed_line(Lattice(tuple("LOT47"), np.log(np.full((5, 5), 0.15))))
    (upside_down,) = other_ways(part, view, lines)
    one_way = replace(upside_down, excluded_by=(doubtful.line,))
    found = reading_of(replace(part, others=(doubtful,)), (one_way,), "9999")
    assert found.flags & ReadingFlag.ORIENTATION_UNKNOWN


def stacked(upper: View, lower: View) -> np.ndarray:
    wide = max(upper.layers.shape[2], lower.layers.shape[2])
    padded = [np.pad(v.layers, ((0, 0), (0, 0), (0, wide - v.layers.shape[2]))) for v in (upper, lower)]
    return np.concatenate(padded, axis=1)


def test_a_mirrored_view_is_that_of_the_mirrored_map() -> None:
    view = view_of("A7")
    assert np.array_equal(view_of("A7", mirrored=True).layers, view.mirrored.layers)
    assert np.array_equal(view.mirrored.mirrored.layers, view.layers)
    assert isinstance(stamp("A7", seed=1).height_map.mirrored, HeightMap)
