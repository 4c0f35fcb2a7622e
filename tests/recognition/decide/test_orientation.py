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
from recognition.decide.evidence import Evidence, Log, SenseEvidence, Source
from recognition.decide.judges import lines
from recognition.decide.reading import Reading
from recognition.find.find import find, search_of
from recognition.find.orientation import read_ways, ways_possible
from recognition.find.part_lines import PartLines
from recognition.find.request import LineRequest
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation, Way
from recognition.language.remainders import ALPHANUMERIC
from recognition.see.levelling import level
from recognition.see.view import View, heights_view
from recognition.settings import ReaderSettings


def view_of(text: str, *, mirrored: bool = False) -> View:
    surface = level(stamp(text, fonts="gothic", height_mm=4.0, seed=3).height_map)
    return heights_view(surface.mirrored if mirrored else surface)


def read(view: View, mask: str, *, rows_known: bool = True) -> tuple[PartLines, LineRequest]:
    request = LineRequest(Grammar(format=mask), ALPHANUMERIC, height_mm=4.0, rows_known=rows_known)
    return find([view], request), request


def reading_of(part: PartLines, request: LineRequest) -> Reading:
    evidence = SenseEvidence("tactile", lines=part, log=Log(rows_known=request.rows_known))
    return decide(Evidence.of(evidence), ReaderSettings(format=request.grammar))


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
    monkeypatch.setattr(lines, "LEAST_LEAD_NATS", math.inf)
    reading = reading_of(*read(view_of("822800"), "999999", rows_known=False))
    assert (reading.text, reading.decision) == ("822800", Decision.REVIEW)
    assert any("also readable with its rows in the other order: " in m for m in reading.messages())


def test_what_a_look_settles_is_no_doubt() -> None:
    part, request = read(view_of("471275"), "999999")
    assert [*part.main.other_ways] == [Way.UPSIDE_DOWN]
    assert not reading_of(part, request).flags & ReadingFlag.ORIENTATION_UNKNOWN


def test_an_orientation_that_was_not_looked_at_stays_possible() -> None:
    part, request = read(view_of("471275"), "999999")
    assert part.main is not None
    unseen = replace(part, main=replace(part.main, other_ways={}))
    assert reading_of(unseen, request).flags & ReadingFlag.ORIENTATION_UNKNOWN


@pytest.mark.parametrize(("seen_text", "looked"), [("471275", False), ("471276", False), ("471275", True)])
def test_touch_that_knows_the_orientation_settles_what_the_camera_does_not(
    seen_text: str, looked: bool
) -> None:
    def evidence(text: str, source: Source, *, looked: bool) -> Evidence:
        part, _ = read(view_of(text), "999999")
        assert part.main is not None
        part = part if looked else replace(part, main=replace(part.main, other_ways={}))
        return Evidence.of(SenseEvidence(source, lines=part, log=Log(rows_known=True)))

    settings = ReaderSettings(format=Grammar(format="999999"))
    felt, seen = evidence("471275", "tactile", looked=True), evidence(seen_text, "vision", looked=looked)
    assert bool(decide(seen, settings).flags & ReadingFlag.ORIENTATION_UNKNOWN) != looked
    reading = decide(felt.joined(seen), settings)
    assert reading.plain_text == "471275"
    assert not reading.flags & ReadingFlag.ORIENTATION_UNKNOWN
    neither = evidence("471275", "tactile", looked=False).joined(evidence("471275", "vision", looked=False))
    assert decide(neither, settings).flags & ReadingFlag.ORIENTATION_UNKNOWN


def test_a_text_that_no_other_way_can_show_is_read_one_way() -> None:
    part, _ = read(view_of("KD2746"), "AA9999")
    assert not part.main.other_ways


@pytest.mark.parametrize(
    ("text", "threshold", "reverse", "doubted"),
    [
        ("LOT47", 0.9, False, False),
        ("LOT47", 1.0, False, True),  # not surely read
        ("LOT47", 0.9, True, True),  # it says that the part lies upside down
        ("HOXN", 0.9, False, True),  # reads upside down as well
    ],
)
def test_another_line_that_reads_one_way_settles_it(
    text: str, threshold: float, reverse: bool, doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(risk, "threshold_of", lambda source, allowed: threshold)
    view, beside = view_of("9608"), view_of(text)
    part, request = read(view, "9999")
    line = find([beside], LineRequest(None, ALPHANUMERIC, height_mm=4.0)).main
    assert part.main is not None
    # both lines stand on one part: the view of the other is below that of the serial
    both = replace(view, layers=stacked(view, beside))
    down = np.array((0.0, view.layers.shape[1] * view.pitch_mm))
    place = replace(line.line, centre_mm=line.line.centre_mm + down)
    place = place.reversed if reverse else place
    line = read_ways(search_of(both, request).under(None), replace(line, line=place), text, [Way.UPSIDE_DOWN])
    reading = reading_of(replace(part, others=(line,)), request)
    assert reading.others[0].text == text
    assert bool(reading.flags & ReadingFlag.ORIENTATION_UNKNOWN) == doubted


def stacked(upper: View, lower: View) -> np.ndarray:
    wide = max(upper.layers.shape[2], lower.layers.shape[2])
    padded = [np.pad(v.layers, ((0, 0), (0, 0), (0, wide - v.layers.shape[2]))) for v in (upper, lower)]
    return np.concatenate(padded, axis=1)


def test_a_mirrored_view_is_that_of_the_mirrored_map() -> None:
    view = view_of("A7")
    assert np.array_equal(view_of("A7", mirrored=True).layers, view.mirrored.layers)
    assert np.array_equal(view.mirrored.mirrored.layers, view.layers)
    assert isinstance(stamp("A7", seed=1).height_map.mirrored, HeightMap)
