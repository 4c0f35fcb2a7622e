"""Readings with the verdict on the text that their parts should read."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from recognition.decision.decide import Decision
from recognition.decision.flags import ReadingFlag
from recognition.decision.reading import Candidate, CharacterReading, Reading
from recognition.decision.verified import with_verification
from recognition.decision.verify import Verdict, Verification
from recognition.language.box import Box
from recognition.language.confusions import CharacterState
from recognition.language.lattice import Lattice

CHARS = "AB18"


def lattice(*places: dict[str, float]) -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(tuple(CHARS), np.log([[place.get(c, 0.0) for c in CHARS] for place in places]))


def reading(text: str) -> Reading:
    characters = tuple(CharacterReading((Candidate(c, 0.9, 0.99),), Box(0.0, 0.0, 1.0, 1.0)) for c in text)
    return Reading(characters, 0.9)


SURE_B1 = lattice({"B": 0.998, "8": 0.001}, {"1": 0.998})
SURE_81 = lattice({"8": 0.998, "B": 0.0001}, {"1": 0.998})


def verdict(
    read: Reading, beliefs: Lattice | None, text: str, **options: Any
) -> tuple[Reading, Verification]:
    found = with_verification(read, beliefs, text, **options)
    assert found.trace.verification is not None
    return found, found.trace.verification


def test_a_reading_bears_the_states_of_what_is_expected() -> None:
    read, found = verdict(reading("81"), SURE_81, "B1")
    assert found.verdict is Verdict.REFUTED
    assert ReadingFlag.MISMATCH in read.flags
    assert (reading("81").decision, read.decision) == (Decision.ACCEPT, Decision.REVIEW)
    states = [c.state for c in read.characters if c.state is not None]
    assert [s.state for s in states] == [CharacterState.MISMATCH, CharacterState.READ]
    assert (states[0].rival, states[0].expected) == ("8", "B")
    read, found = verdict(reading("81"), SURE_81, "8 1")
    assert found.verdict is Verdict.CONFIRMED
    assert read.flags is ReadingFlag.NONE
    assert read.text == "81"


def test_without_characters_nothing_is_known() -> None:
    read, found = verdict(replace(reading("B1"), characters=()), None, "B1")
    assert (found.verdict, found.probability) == (Verdict.UNDECIDED, 0.0)
    assert read.flags is ReadingFlag.NONE
    assert "0 characters were found where 2 are expected" in found.messages()[0]


def test_senses_that_contradict_each_other_confirm_nothing() -> None:
    read, found = verdict(reading("B1"), SURE_B1, "B1", contradicted=True)
    assert found.verdict is Verdict.UNDECIDED
    assert read.flags is ReadingFlag.SENSES_DISAGREE
    read, found = verdict(reading("81"), SURE_81, "B1", contradicted=True)
    assert found.verdict is Verdict.REFUTED
    assert read.flags is ReadingFlag.SENSES_DISAGREE | ReadingFlag.MISMATCH
