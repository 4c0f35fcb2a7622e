"""How far a reading takes a part, what felt parts say of the bench, and the scale of a scan without a height."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from glyphs.errors import MarksError
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import Agreement, PartState
from pipeline.reading.bench_watch import LATEST, SHOWN_BY, BenchWatch
from pipeline.reading.character_height import find_height_mm
from pipeline.reading.triage import agreement_of, state_after
from recognition.reader import Reader
from recognition.settings import ReaderSettings


def reading(text: str = "KX407251", decision: str = "accept", source: str = "vision") -> ReadingRecord:
    return ReadingRecord(source, text, decision, 0.9)


@pytest.mark.parametrize(
    ("made", "expected", "agreement", "state"),
    [
        (reading(), "KX407251", Agreement.SAME, PartState.ACCEPTED),
        (reading("KX40 7251"), " KX4 07251 ", Agreement.SAME, PartState.ACCEPTED),  # blanks are not stamped
        (reading(), "KX407257", Agreement.OTHER, PartState.ACCEPTED),
        (reading(), "NO READ", Agreement.OTHER, PartState.ACCEPTED),
        (reading(decision="review"), "KX407251", Agreement.SAME, PartState.TOUCH_NEEDED),
        (reading(decision="review", source="fused"), "KX407251", Agreement.SAME, PartState.REVIEW),
        (reading("", "reject"), "KX407251", Agreement.NOTHING, PartState.TOUCH_NEEDED),
        (reading(), "", Agreement.ALONE, PartState.ACCEPTED),
        (reading("", "reject"), " ", Agreement.ALONE, PartState.TOUCH_NEEDED),
    ],
)
def test_beside_the_lines_own_reader(
    made: ReadingRecord, expected: str, agreement: Agreement, state: PartState
) -> None:
    assert (agreement_of(made, expected), state_after(made)) == (agreement, state)


DEAD = "whisker 3, dead whisker: gives 1 % of the moment of land (see whether it is broken)"
STILL_DEAD = "whisker 3, dead whisker: gives 0 % of the moment of land (see whether it is broken)"
SPIKES = "spikes: 40 single samples stand out (screen the wires)"


def test_one_part_alone_tells_nothing() -> None:
    watch = BenchWatch()
    assert not watch.add([SPIKES])
    assert watch.message() == ""
    assert watch.parts == 1


def test_what_parts_show_one_after_the_other_is_told_once_in_the_latest_words() -> None:
    watch = BenchWatch()
    assert [watch.add([DEAD]), watch.add([STILL_DEAD, SPIKES]), watch.add([DEAD])] == [False, True, False]
    assert watch.message() == DEAD
    watch.add([SPIKES])
    assert watch.message() == f"{SPIKES}; {DEAD}"


def test_it_is_over_when_the_latest_parts_are_sound() -> None:
    watch = BenchWatch()
    for _ in range(LATEST):
        watch.add([DEAD])
    for left in range(LATEST - SHOWN_BY + 1, -1, -1):
        assert bool(watch.message()) == (left > 0)
        watch.add([])


def read_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose font it is takes long and is not the subject."""
    gothic = Reader(ReaderSettings(fonts=("gothic",), experts=("network",)))
    monkeypatch.setattr("pipeline.reading.character_height.Reader", lambda: gothic)


def test_dirt_does_not_make_the_characters_taller(monkeypatch: pytest.MonkeyPatch) -> None:
    """On this part the highest band is dirt and line together."""
    read_quickly(monkeypatch)
    part = stamp("KX407251", fonts="gothic", height_mm=5.0, seed=3, dirt=0.6)
    # shops stamp within a few percent of the height asked for
    assert find_height_mm(part.height_map, soil=part.soil) == pytest.approx(5.0, rel=0.06)


def test_a_map_without_characters_needs_a_height(monkeypatch: pytest.MonkeyPatch) -> None:
    read_quickly(monkeypatch)
    flat = HeightMap(np.zeros((30, 60), np.float32), 0.1)
    with pytest.raises(MarksError, match="--height-mm"):
        find_height_mm(flat)
