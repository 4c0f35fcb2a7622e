"""What recogniser and templates believe of one line, on steps put together by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.recogniser.read_line import combine_looks, count_places, with_slip
from recognition.recogniser.steps import Steps
from recognition.see.text_line import TextLine

CHARS = "AB8"
LINE = TextLine.straight(0.0, 5.0, length_mm=20.0, height_mm=5.0)
SLIP = 1e-4


def steps(text: str, *, sure: float = 0.9, rival: str = "") -> Steps:
    """A blank, a character, a blank and so on; what is left of a character's belief is its rival's, or blank's."""
    blank, shares = np.full(2 * len(text) + 1, 0.999), np.zeros((2 * len(text) + 1, len(CHARS)))
    for k, char in enumerate(text):
        step = 2 * k + 1
        shares[step, CHARS.index(char)] = sure
        blank[step] = 0.0 if rival else 1.0 - sure
        if rival:
            shares[step, CHARS.index(rival[k])] = 1.0 - sure
    return Steps.of(blank, shares, CHARS, np.arange(blank.size) * 14.0)


def lattice(*rows: tuple[float, ...]) -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(tuple(CHARS), np.log(np.array(rows)))


def share(belief: Lattice, place: int, char: str) -> float:
    return float(np.exp(belief.log_belief[place, belief.chars.index(char)]))


@given(st.lists(st.floats(0.01, 1.0), min_size=3, max_size=3))
def test_every_allowed_character_keeps_some_probability(values: list[float]) -> None:
    row = np.array(values) / (sum(values) + 0.05)
    before, unsure = lattice(tuple(row)), lattice((0.0, 1.0 - 1e-9, 1e-9))
    slipped = with_slip(before, slip=SLIP)
    np.testing.assert_allclose(np.exp(slipped.log_belief), np.exp(before.log_belief), atol=SLIP)
    np.testing.assert_allclose(np.exp(slipped.log_belief).sum(), row.sum())
    assert np.isneginf(with_slip(unsure, slip=SLIP).log_belief[0, 0])
    assert share(with_slip(unsure, slip=SLIP), 0, "8") >= 0.5 * SLIP


@pytest.mark.parametrize("text", ["A", "AB", "AAB", "8A8A8A8A"])
def test_characters_are_counted(text: str) -> None:
    looks = [steps(text, sure=0.97)]
    assert count_places(looks)[0] == len(text)
    # of looks that differ the likelier number
    assert count_places([*looks * 2, steps(text + "A", sure=0.55)])[0] == len(text)


def test_a_line_is_read_with_and_without_a_format() -> None:
    looks = [steps("A8B", sure=0.9, rival="BAA")]
    free = combine_looks(LINE, looks, None)
    assert free.lattice.text == "A8B"
    assert free.evidence == 0.0
    # columns of steps 1, 3 and 5
    np.testing.assert_allclose(free.columns, [14.0, 42.0, 70.0], atol=1.0)
    forced = combine_looks(LINE, looks, Grammar(sets=("AB", "AB", "AB")))
    assert forced.lattice.text == "AAB"
    assert np.isneginf(forced.lattice.log_belief[:, CHARS.index("8")]).all()
    # what the format leaves of all that is believed: the rival's tenth at one place
    assert forced.evidence == pytest.approx(np.log(0.1), abs=0.05)
    assert free.promise > forced.promise
    assert forced.open_places[0].text == "A8B"


def test_of_several_lengths_the_one_that_explains_most() -> None:
    grammar = Grammar(expression="[AB8]{2}|[AB8]{4}")
    for text in ("AB", "AB8A"):
        line = combine_looks(LINE, [steps(text)], grammar)
        assert line.lattice.text == text
        assert set(line.by_expert) == {"network"}


def test_a_line_with_no_room_for_the_format_is_no_belief() -> None:
    assert combine_looks(LINE, [steps("A")], Grammar(sets=("AB",) * 9)) is None


def test_several_looks_count_as_one() -> None:
    once = combine_looks(LINE, [steps("A8B", sure=0.8)], None)
    thrice = combine_looks(LINE, [steps("A8B", sure=0.8)] * 3, None)
    np.testing.assert_allclose(thrice.lattice.log_belief, once.lattice.log_belief, atol=1e-9)
