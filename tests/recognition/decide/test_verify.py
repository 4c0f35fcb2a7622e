"""A known serial against a line, and of a reading: confirmed, refuted, or left open."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.decide import risk as room
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.evidence import Evidence
from recognition.decide.reading import Reading
from recognition.decide.verify import Verdict, Verification, VerifyError, verify
from recognition.language.confusions import CharacterState
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.settings import ReaderSettings
from tests.support.evidence import sense_of

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


def line(text: str, *, beliefs: dict[int, dict[str, float]] | None = None) -> Lattice:
    """Each character believed in ("." stands for nothing at all); the beliefs of single places may be given.

    A hundredth of what is left goes to each other character, the rest to no character.
    """
    p = np.full((len(text), len(ALPHABET)), 1e-5)
    for k, char in enumerate(text):
        if char != ".":
            p[k, ALPHABET.index(char)] = 0.999
    for k, given_ in (beliefs or {}).items():
        p[k] = 1e-6
        for char, value in given_.items():
            p[k, ALPHABET.index(char)] = max(value, 1e-12)
    return Lattice(tuple(ALPHABET), np.log(p))


def test_the_same_is_confirmed_and_another_refuted() -> None:
    same = verify(line("AB123456"), "AB 123456")
    assert same.verdict is Verdict.CONFIRMED
    assert same.expected == "AB123456"
    assert same.probability == pytest.approx(0.999**8, abs=1e-4)
    assert same.messages() == ()
    other = verify(line("AB123456"), "AB123457")
    assert other.verdict is Verdict.REFUTED
    assert other.messages() == ("place 8: 6 where 7 is expected",)
    assert [c.state.state for c in other.characters] == [CharacterState.READ] * 7 + [CharacterState.MISMATCH]


def test_dirt_speaks_neither_way() -> None:
    dirty = verify(line("AB12...."), "AB123456")
    assert dirty.verdict is Verdict.UNDECIDED
    assert dirty.refutation < 0.01
    assert dirty.probability < 1e-6
    assert dirty.messages()[0] == "place 5: 3 cannot be made out"
    # but one clear other character among the dirt refutes all the same
    assert verify(line("AB17...."), "AB123456").verdict is Verdict.REFUTED


def test_a_doubtful_character_leaves_it_open() -> None:
    doubted = verify(line("AB123456", beliefs={3: {"2": 0.6, "Z": 0.39}}), "AB123456")
    assert doubted.verdict is Verdict.UNDECIDED
    assert doubted.characters[3].state.state is CharacterState.CONFUSED
    assert doubted.messages() == ("place 4: 2 or Z (the bow of 2 has a corner in narrow fonts)",)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_as_by_writing_every_case_out(seed: int) -> None:
    """Same and differing against all combinations of characters and nothing at three places."""
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(4, 0.3), size=3) + 1e-12
    p /= p.sum(axis=1, keepdims=True)
    lattice = Lattice(tuple("ABC"), np.log(p[:, :3]))
    same = differs = 0.0
    for line_ in itertools.product("ABC.", repeat=3):
        weight = math.prod(p[k, "ABC.".index(c)] for k, c in enumerate(line_))
        if any(c not in (e, ".") for c, e in zip(line_, "CAB", strict=True)):
            differs += weight
        elif "." not in line_:
            same += weight
    verification = verify(lattice, "CAB")
    # absolute: differences of products near 1
    assert verification.probability == pytest.approx(same, abs=1e-9)
    assert verification.refutation == pytest.approx(differs, abs=1e-9)


@pytest.mark.parametrize(
    ("found", "left_over"),
    [("B123456", (None, "A")), ("AB23456", (None, "1")), ("AB12345", (None, "6"))],
)
def test_a_missing_place_is_found(found: str, left_over: tuple[int | None, str]) -> None:
    result = verify(line(found), "AB123456")
    assert result.verdict is Verdict.UNDECIDED
    assert result.probability == 0.0
    odd = [c for c in result.characters if c.state.state is not CharacterState.READ]
    assert [(c.place, c.state.expected) for c in odd] == [left_over]
    assert result.messages()[0] == "7 characters were found where 8 are expected"
    assert "no place was found for" in result.messages()[1]


def test_a_place_too_many_is_found() -> None:
    result = verify(line("AB1123456"), "AB123456")
    assert result.verdict is Verdict.UNDECIDED
    extra = [c for c in result.characters if not c.state.expected]
    assert len(extra) == 1
    assert extra[0].message == "1 where nothing is expected"
    assert result.messages()[1].startswith("after place")
    # of another length and with another character: refuted
    assert verify(line("AB17345"), "AB123456").verdict is Verdict.REFUTED


def test_an_empty_line_leaves_it_open() -> None:
    nothing = verify(Lattice(tuple("AB"), np.empty((0, 2))), "AB")
    assert nothing.verdict is Verdict.UNDECIDED
    assert nothing.refutation == 0.0
    assert nothing.messages() == ("0 characters were found where 2 are expected",)


def test_a_wrong_serial_may_break_the_format() -> None:
    grammar = Grammar.parse("AA999999")
    clear = line("AB12345G")
    free, held = verify(clear, "AB123456"), verify(clear, "AB123456", grammar=grammar)
    assert held.verdict is free.verdict is Verdict.REFUTED
    assert held.refutation == free.refutation


@pytest.mark.parametrize(
    ("expected", "options", "said"),
    [
        (" ", {}, "is empty"),
        ("AB12-456", {}, "does not look for"),
        ("AB12345X", {"grammar": Grammar(format="AA999999")}, "does not fit the format AA999999"),
    ],
)
def test_what_cannot_be_looked_for_is_said(expected: str, options: dict[str, object], said: str) -> None:
    with pytest.raises(VerifyError, match=said):
        verify(line("AB123456"), expected, **options)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------- of a reading


FEW = "AB18"


def lattice_of(*places: dict[str, float]) -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(tuple(FEW), np.log([[place.get(c, 0.0) for c in FEW] for place in places]))


SURE_B1 = lattice_of({"B": 0.998, "8": 0.001}, {"1": 0.998})
SURE_81 = lattice_of({"8": 0.998, "B": 0.0001}, {"1": 0.998})
TWO_PLACES = ReaderSettings(format=Grammar(sets=(FEW, FEW)), orientation=Orientation.UPRIGHT)


def verdict(
    beliefs: Lattice | None, text: str, seen: Lattice | None = None, *, accept: float = 0.9
) -> tuple[Reading, Verification]:
    """The reading that these beliefs make if a text is expected."""
    camera = None if seen is None else sense_of(seen, "vision")
    evidence = Evidence(sense_of(beliefs), camera, expected=text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "threshold_of", lambda source, risk: accept)
        verification = decide(evidence, TWO_PLACES)
    assert verification.trace.verification is not None
    return verification, verification.trace.verification


def test_a_reading_bears_the_states_of_what_is_expected() -> None:
    read, verification = verdict(SURE_81, "B1")
    assert verification.verdict is Verdict.REFUTED
    assert (read.flags, read.decision) == (ReadingFlag.MISMATCH, Decision.REVIEW)
    states = [c.state for c in read.characters if c.state is not None]
    assert [s.state for s in states] == [CharacterState.MISMATCH, CharacterState.READ]
    assert (states[0].rival, states[0].expected) == ("8", "B")
    read, verification = verdict(SURE_81, "8 1")
    assert verification.verdict is Verdict.CONFIRMED
    assert (read.flags, read.decision) == (ReadingFlag.NONE, Decision.ACCEPT)
    assert read.text == "81"


DOUBTED_B1 = lattice_of({"B": 0.97, "8": 0.03}, {"1": 0.998})


@pytest.mark.parametrize(
    ("accept", "text", "verdict_and_probability"),
    [
        (0.5, "B1", (Verdict.CONFIRMED, None)),
        (1.0, "B1", (Verdict.UNDECIDED, 0.97 * 0.998)),
        (0.5, "81", (Verdict.UNDECIDED, 0.03 * 0.998)),
    ],
)
def test_a_reading_that_is_accepted_confirms_its_text(
    accept: float, text: str, verdict_and_probability: tuple[Verdict, float | None]
) -> None:
    read, verification = verdict(DOUBTED_B1, text, accept=accept)
    kind, probability = verdict_and_probability
    expected = max(read.confidence, 0.97 * 0.998) if probability is None else probability
    assert (verification.verdict, verification.probability) == (kind, pytest.approx(expected))


def test_without_characters_nothing_is_known() -> None:
    read, verification = verdict(None, "B1")
    assert (verification.verdict, verification.probability) == (Verdict.UNDECIDED, 0.0)
    assert read.flags is ReadingFlag.NO_CHARACTERS
    assert "0 characters were found where 2 are expected" in verification.messages()[0]


def test_senses_that_contradict_each_other_confirm_nothing() -> None:
    read, verification = verdict(SURE_B1, "B1", SURE_81)
    assert verification.verdict is Verdict.UNDECIDED
    assert read.flags & ReadingFlag.SENSES_DISAGREE
    read, verification = verdict(SURE_81, "B1", SURE_81)
    assert verification.verdict is Verdict.REFUTED
    assert read.flags & ReadingFlag.MISMATCH
