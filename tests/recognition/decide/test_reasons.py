"""What a person is given as the reasons of a review: few, in order, with places, and none that does not apply."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recognition.decide.decision import Decision, Finding, ReadingFlag
from recognition.decide.judges.score import low_confidence
from recognition.decide.judges.strokes import missing_strokes
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.language.box import Box
from recognition.language.confusions import state_of
from recognition.language.lattice import Lattice
from recognition.marks.grade import Action, MarkGrade, Parameter
from tests.support.evidence import judged, sense_of, text_of

UNSURE = ReadingFlag.LOW_CONFIDENCE


def place(*beliefs: tuple[str, float], completeness: float | None = None) -> CharacterReading:
    grade = None
    if completeness is not None:
        letter = 0 if completeness < 0.6 else 4
        action = Action.CLEAN_FIRST if completeness < 0.6 else Action.NONE
        grade = MarkGrade((Parameter("completeness", completeness, letter),), action)
    return CharacterReading(
        tuple(Candidate(c, 1.0, p) for c, p in beliefs),
        Box(0.0, 0.0, 1.0, 1.0),
        state=state_of(dict(beliefs)),
        grade=grade,
    )


SURE, FAINT = place(("K", 0.99), ("X", 0.01)), place(("B", 0.7), ("8", 0.2))
CLOSE, UNREAD = place(("1", 0.5), ("I", 0.4)), place(("7", 0.2), ("T", 0.1))


def review(
    *characters: CharacterReading,
    flags: ReadingFlag,
    confidence: float = 0.3,
    findings: tuple[Finding, ...] = (),
    threshold: float = 0.98,
    likely: float = 1.0,
) -> Reading:
    """A reading with these flags in general words; a low confidence is explained as the decision does."""
    sense = sense_of(Lattice(("A",), np.zeros((len(characters), 1))), likely=likely)
    choice = text_of(characters, score=confidence, threshold=threshold, senses=(sense,))
    doubts = judged(choice, low_confidence) if flags & UNSURE else ()
    general = (Finding.of(flag) for flag in flags & ~UNSURE)
    return Reading(characters, confidence, (*doubts, *general, *findings))


LOW = "confidence 0.300 is below the threshold 0.98 for 1 in 1,000"


def test_low_confidence_names_the_places_worst_first() -> None:
    doubtful = review(SURE, FAINT, CLOSE, flags=UNSURE)
    assert doubtful.messages() == (f"{LOW}: 1 or I at place 3, B or 8 at place 2?",)


def test_a_confidence_below_the_threshold_is_told_in_numbers() -> None:
    reading = review(SURE, CLOSE, flags=UNSURE, confidence=0.965)
    assert reading.messages() == (
        "confidence 0.965 is below the threshold 0.98 for 1 in 1,000: 1 or I at place 2?",
    )
    # the confidence of now counts, and it never looks like the threshold
    reading = review(SURE, flags=UNSURE, confidence=0.97996)
    assert reading.messages() == ("confidence 0.97996 is below the threshold 0.98 for 1 in 1,000",)


def test_findings_of_one_kind_are_one_reason() -> None:
    reading = review(
        SURE,
        CLOSE,
        flags=ReadingFlag.NONE,
        findings=(
            Finding(ReadingFlag.STROKES_UNDECIDED, "K or X at place 1: not felt (clean it)"),
            Finding(ReadingFlag.STROKES_UNDECIDED, "1 or I at place 2: not felt (clean it)"),
            Finding(ReadingFlag.STROKES_UNDECIDED, "1 or I at place 2: not felt (clean it)"),
        ),
    )
    assert reading.messages() == ("K or X at place 1, 1 or I at place 2: not felt (clean it)",)


def test_a_place_that_cannot_be_read_is_not_guessed_at() -> None:
    reading = review(SURE, CLOSE, UNREAD, UNREAD, flags=UNSURE)
    assert reading.messages() == (
        f"{LOW}: 1 or I at place 2?",
        "no character can be made out: places 3 and 4 (look at the part)",
    )


@pytest.mark.parametrize(
    ("likely", "words"),
    [
        (
            1.0,
            "confidence 0.960 is below the threshold 0.98 for 1 in 1,000: K at place 1 is the least certain",
        ),
        (0.5, "confidence 0.960 is below the threshold 0.98 for 1 in 1,000: are there 2 characters?"),
    ],
)
def test_where_no_place_has_a_rival_the_doubt_is_named_all_the_same(likely: float, words: str) -> None:
    reading = review(SURE, place(("7", 0.995)), flags=UNSURE, confidence=0.96, likely=likely)
    assert reading.messages() == (words,)


def test_at_most_two_reasons_in_order_of_importance() -> None:
    flags = UNSURE | ReadingFlag.DROPOUTS
    reading = review(
        SURE,
        CLOSE,
        flags=flags,
        findings=(
            Finding(ReadingFlag.FORMAT_OVERRULED, "the format changed what was read: 8 to B at place 2"),
            Finding(ReadingFlag.UNREAD_MARKS, "another line reads “SN8”"),
        ),
    )
    assert reading.messages() == (
        f"{LOW}: 1 or I at place 2?",
        "another line reads “SN8”",
        ReadingFlag.DROPOUTS.text,
    )


def test_every_rule_that_is_broken_is_named() -> None:
    reading = review(
        SURE,
        CLOSE,
        flags=UNSURE,
        findings=(
            Finding(ReadingFlag.UNREAD_MARKS, "another line reads “SN8”"),
            Finding(ReadingFlag.TOO_SHALLOW, "too shallow for one"),
            Finding(ReadingFlag.TOO_SHALLOW, "too shallow for another"),
        ),
    )
    assert reading.messages()[2:] == ("too shallow for one", "too shallow for another")


def test_doubt_of_another_line_is_not_one_of_the_serial() -> None:
    lot = Finding(ReadingFlag.LINE_MISSING, "low confidence: lot LOT77?")
    reading = review(SURE, SURE, flags=ReadingFlag.NONE, confidence=0.98, findings=(lot,))
    assert reading.messages() == (lot.text,)


def test_notes_come_last() -> None:
    reading = replace(review(CLOSE, flags=UNSURE), notes=("read by touch alone",))
    assert reading.messages() == (f"{LOW}: 1 or I at place 1?", "read by touch alone")


def test_a_character_without_most_of_its_strokes_is_named() -> None:
    filled, whole = place(("I", 0.99), completeness=0.1), place(("7", 0.99), completeness=0.95)
    (finding,) = judged(text_of((filled, whole), score=0.97), missing_strokes)
    assert finding.text == "most strokes are missing: I at place 1 (clean it and scan it again)"
    reading = Reading((filled, whole), 0.97, (finding,), threshold=0.98)
    assert reading.actions == (Action.CLEAN_FIRST, Action.NONE)


def test_many_places_are_counted_up() -> None:
    worn = place(("7", 0.99), completeness=0.1)
    grade = replace(worn.grade, action=Action.RE_STRIKE)  # type: ignore[type-var]
    parts = (
        *[replace(worn, grade=grade)] * 4,
        place(("K", 0.99), completeness=1.0),
        replace(worn, grade=grade),
    )
    (finding,) = judged(text_of(parts), missing_strokes)
    assert finding.text == "most strokes are missing: places 1 to 4 and 6 (strike it again)"


def test_what_is_accepted_asks_for_nothing() -> None:
    dirty = place(("K", 0.99), completeness=0.1)
    assert judged(text_of((dirty,), score=0.99), missing_strokes) == ()
    accepted = Reading((dirty,), 0.99)
    assert (accepted.decision, accepted.messages(), accepted.actions) == (Decision.ACCEPT, (), (Action.NONE,))
    # its grade is what it was
    assert accepted.characters[0].grade.letter == "F"
