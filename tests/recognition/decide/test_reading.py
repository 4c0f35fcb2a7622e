"""The value types of a reading."""

from __future__ import annotations

import pytest

from recognition.decide.decision import ReadingFlag
from recognition.decide.reading import Box, Candidate, CharacterReading, Reading
from recognition.marks.depth import MarkDepth

BOX = Box(0.0, 0.0, 1.0, 2.0)


def character(*beliefs: tuple[str, float]) -> CharacterReading:
    return CharacterReading(tuple(Candidate(c, 0.9, p) for c, p in beliefs), BOX)


@pytest.mark.parametrize("corners", [(1.0, 0.0, 0.5, 1.0), (0.0, 1.0, 1.0, 0.5)])
def test_a_box_does_not_end_before_it_begins(corners: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="ends before it begins"):
        Box(*corners)


def test_a_character_has_a_candidate() -> None:
    with pytest.raises(ValueError, match="at least one"):
        CharacterReading((), BOX)


def test_confidence_and_margin_are_those_of_the_leaders() -> None:
    both = character(("A", 0.7), ("4", 0.2), ("H", 0.1))
    assert both.char == "A"
    assert both.confidence == 0.7
    assert both.margin == pytest.approx(0.5)
    # without a rival the lead is the whole belief
    alone = character(("A", 0.7))
    assert alone.margin == alone.confidence == 0.7


def test_seven_characters_one_in_doubt_say_more_than_a_sure_one() -> None:
    def reading(*beliefs: float) -> Reading:
        characters = tuple(character(("A", belief)) for belief in beliefs)
        return Reading(characters=characters, confidence=min(beliefs), threshold=1.0)

    assert reading(0.5, *[0.99] * 6).nats_read > reading(0.85).nats_read
    assert reading(0.9, 0.9).nats_read > reading(0.9, 0.7).nats_read
    # noise read as eight characters is worth less than nothing, however unlikely each is
    assert reading(*[0.1] * 8).nats_read < 0.0 < reading(0.85).nats_read
    assert reading(0.0).nats_read == -2.0


def test_every_flag_has_words_of_its_own() -> None:
    assert all(flag.text for flag in ReadingFlag)
    assert len({flag.text for flag in ReadingFlag}) == len(ReadingFlag)


def test_the_depth_of_a_reading_is_that_of_the_characters_felt() -> None:
    depths = (MarkDepth(0.2, 0.15, 0.22), None, MarkDepth(0.1, 0.05, 0.12))
    characters = tuple(CharacterReading((Candidate("A", 0.9, 1.0),), BOX, depth) for depth in depths)
    reading = Reading(characters, 1.0)
    assert reading.depth_min_mm == 0.05
    assert reading.depth_mean_mm == pytest.approx(0.15)
    unknown = Reading(characters[1:2], 1.0)
    assert unknown.depth_min_mm is None
    assert unknown.depth_mean_mm is None
