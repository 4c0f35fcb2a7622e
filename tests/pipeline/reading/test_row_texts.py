"""Places in the few characters that a table has room for."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.reading.row_texts import (
    action_text,
    alternatives_text,
    depths_text,
    grade_letters,
    rivals_text,
    state_text,
    states_text,
    worst_letter,
)
from recognition.confusions import CharacterState, PlaceState
from recognition.grade import Action, MarkGrade, Parameter
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.reading import Box, Candidate, CharacterReading, Decision, MarkDepth, Reading

BOX = Box(0.0, 0.0, 1.0, 1.0)


def grade(letter: str, action: Action = Action.NONE) -> MarkGrade:
    if letter == "?":
        return MarkGrade((), Action.FEEL_AGAIN)
    return MarkGrade((Parameter("contrast", 0.5, "FDCBA".index(letter)),), action)


def reading(*characters: CharacterReading, source: str = "tactile") -> Reading:
    return Reading(characters, Decision.REVIEW, 0.5, source=source)


def place(
    *candidates: tuple[str, float], state: PlaceState | None = None, mark: MarkGrade | None = None
) -> CharacterReading:
    return CharacterReading(tuple(Candidate(c, p, p) for c, p in candidates), BOX, state=state, grade=mark)


READ = PlaceState(CharacterState.READ, "A", 0.99)
CONFUSED = PlaceState(CharacterState.CONFUSED, "8", 0.5, "B", 0.4)
MISMATCH = PlaceState(CharacterState.MISMATCH, "8", 0.9, "8", 0.9, expected="B")
LEFT_OVER = PlaceState(CharacterState.MISMATCH, "8", 0.9, "8", 0.9, expected="")
NOT_READ = PlaceState(CharacterState.NOT_READ, "A", 0.1)


def test_states_name_the_places_that_are_not_plainly_read() -> None:
    found = reading(*(place(("A", 0.9), state=s) for s in (READ, CONFUSED, NOT_READ, MISMATCH, None)))
    assert states_text(found) == "2:confused 8/B, 3:not read, 4:mismatch 8/B"
    assert state_text(READ) == "read"
    assert state_text(LEFT_OVER) == "mismatch 8/-"
    assert states_text(reading()) == ""


def test_alternatives_have_some_belief() -> None:
    found = reading(place(("8", 0.7), ("B", 0.2), ("S", 0.001)), place(("A", 0.99)))
    assert alternatives_text(found) == "1:B"


def test_grades_and_the_worst() -> None:
    found = reading(*(place(("A", 0.9), mark=None if g == "." else grade(g)) for g in "AC.B?"))
    assert grade_letters(found) == "AC?B?"
    assert worst_letter(found) == "C"
    ungraded = reading(place(("A", 0.9)))
    assert (grade_letters(ungraded), worst_letter(ungraded), action_text(ungraded)) == ("", "", "")
    assert worst_letter(reading(place(("A", 0.9), mark=grade("?")))) == "?"


def test_actions_name_their_places() -> None:
    marks = (Action.RE_STRIKE, Action.CLEAN, Action.NONE, Action.CLEAN)
    found = reading(*(place(("A", 0.9), mark=grade("D", action)) for action in marks))
    assert action_text(found) == "clean 2 4, re-strike 1"


def test_depths_are_of_touch() -> None:
    felt = reading(
        place(("A", 0.9)), CharacterReading((Candidate("B", 0.9, 0.9),), BOX, MarkDepth(0.2, 0.1, 0.3))
    )
    assert depths_text(felt) == "A ? B 0.100/0.200"
    assert depths_text(reading(place(("A", 0.9)), source="vision")) == ""


def lattice() -> Lattice:
    belief = np.array([[0.7, 0.29, 0.0, 0.0], [0.0, 0.0, 0.6, 0.39]])
    with np.errstate(divide="ignore"):
        return Lattice(("8", "B", "1", "7"), np.log(belief))


def test_rivals_are_whole_serials_of_the_format() -> None:
    read = reading(place(("8", 0.7), ("B", 0.29)), place(("1", 0.6), ("7", 0.39)))
    free = rivals_text(read, lattice(), None)
    assert [told.split()[0] for told in free.split(", ")] == ["87", "B1", "B7"]
    # 0.99 of belief in something at each place: the products as they are, but for doubt that counts once
    assert [float(told.split()[1]) for told in free.split(", ")] == pytest.approx(
        [0.273, 0.174, 0.113], abs=0.001
    )
    only = rivals_text(read, lattice(), Grammar(lexicon=frozenset({"81", "B7", "8888"})))
    assert only.split()[0] == "B7"
    assert "," not in only


def test_the_candidates_stand_in_for_a_lattice() -> None:
    read = reading(place(("8", 0.7), ("B", 0.29)), place(("1", 0.6), ("7", 0.39)))
    assert rivals_text(read, None, None) == rivals_text(read, lattice(), None)
    assert rivals_text(reading(), None, None) == ""


def test_a_lattice_of_other_length_does_not_count() -> None:
    read = reading(place(("8", 0.7), ("B", 0.29)))
    assert rivals_text(read, lattice(), None).split()[0] == "B"
