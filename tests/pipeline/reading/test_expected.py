"""Readings held against what the parts should bear."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glyphs.errors import FileError
from pipeline.common.settings import SettingsError
from pipeline.reading.expected import Expected, load_expected, verify_reading
from recognition.confusions import CharacterState
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.reading import Box, Candidate, CharacterReading, Decision, Reading, ReadingFlag
from recognition.verify import Verdict, VerifyError

CHARS = "AB18"


def lattice(*places: dict[str, float]) -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(tuple(CHARS), np.log([[place.get(c, 0.0) for c in CHARS] for place in places]))


def reading(text: str) -> Reading:
    characters = tuple(CharacterReading((Candidate(c, 0.9, 0.99),), Box(0.0, 0.0, 1.0, 1.0)) for c in text)
    return Reading(characters, Decision.ACCEPT, 0.9)


SURE_B1 = lattice({"B": 0.998, "8": 0.001}, {"1": 0.998})
SURE_81 = lattice({"8": 0.998, "B": 0.0001}, {"1": 0.998})
DIRTY = lattice({"B": 0.1, "8": 0.1}, {"1": 0.1})


def test_one_text_for_all_or_a_table(tmp_path: Path) -> None:
    one = load_expected(" AB 18 ")
    assert (one.of("a"), one.of("b")) == ("AB 18", "AB 18")
    assert one.not_among([]) == ()
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na.npz,AB18\nb,AB81\n", encoding="utf-8")
    table = load_expected(str(path))
    assert (table.of("a"), table.of("folder/b"), table.of("c")) == ("AB18", "AB81", None)
    assert table.not_among(["folder/b"]) == ("a",)
    # a table by any other name is one too, a text with a point in it is none
    assert load_expected(str(path.rename(tmp_path / "wanted"))).by_part == table.by_part
    assert load_expected("A.B").text == "A.B"


def test_what_cannot_be_expected_is_told_before_the_run(tmp_path: Path) -> None:
    grammar = Grammar(mask="AA99")
    with pytest.raises(SettingsError, match="--verify is 'AB1', but it does not fit mask:AA99; mend"):
        load_expected("AB1", grammar)
    with pytest.raises(SettingsError, match="--verify is empty"):
        load_expected(" ")
    with pytest.raises(FileError, match="is not there"):
        load_expected(str(tmp_path / "none.csv"))
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na,AB18\nb,\n", encoding="utf-8")
    with pytest.raises(FileError, match="gives no text for b"):
        load_expected(str(path))
    path.write_text("part,text\na,AB18\nb,AB1\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"wanted\.csv: b should bear 'AB1', but it does not fit mask:AA99"):
        load_expected(str(path), grammar)


def test_a_reading_bears_the_states_of_what_is_expected() -> None:
    told, found = verify_reading(reading("81"), SURE_81, "B1")
    assert found.verdict is Verdict.REFUTED
    assert ReadingFlag.MISMATCH in told.flags
    states = [c.state for c in told.characters if c.state is not None]
    assert [s.state for s in states] == [CharacterState.MISMATCH, CharacterState.READ]
    assert (states[0].rival, states[0].expected) == ("8", "B")
    told, found = verify_reading(reading("81"), SURE_81, "8 1")
    assert found.verdict is Verdict.CONFIRMED
    assert told.flags is ReadingFlag.NONE
    assert told.text == "81"


def test_without_characters_nothing_is_known() -> None:
    told, found = verify_reading(replace(reading("B1"), characters=()), None, "B1")
    assert (found.verdict, found.probability) == (Verdict.UNDECIDED, 0.0)
    assert told.flags is ReadingFlag.NONE
    assert "0 characters were found where 2 are expected" in found.messages()[0]


def test_a_text_of_other_characters_cannot_be_looked_for() -> None:
    with pytest.raises(VerifyError, match="which was not looked for"):
        verify_reading(reading("B1"), SURE_B1, "X1")


def test_dirt_speaks_neither_way() -> None:
    told, found = verify_reading(reading("B1"), DIRTY, "B1")
    assert found.verdict is Verdict.UNDECIDED
    assert told.flags is ReadingFlag.NONE


def test_senses_that_contradict_each_other_confirm_nothing() -> None:
    told, found = verify_reading(reading("B1"), SURE_B1, "B1", contradicted=True)
    assert found.verdict is Verdict.UNDECIDED
    assert told.flags is ReadingFlag.SENSES_DISAGREE
    told, found = verify_reading(reading("81"), SURE_81, "B1", contradicted=True)
    assert found.verdict is Verdict.REFUTED
    assert told.flags is ReadingFlag.SENSES_DISAGREE | ReadingFlag.MISMATCH


def test_a_text_that_is_empty_is_none() -> None:
    assert Expected().of("a") is None
