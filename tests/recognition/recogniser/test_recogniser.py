"""The recogniser: what becomes of its classes, what it reads in an unnamed font, what is believed of a line."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs.stamping.stamp import StampedPart
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.read_line import combine_looks, with_slip
from recognition.recogniser.recogniser import CHARACTERS, STEP_COLUMNS, posteriors, steps_of
from recognition.recogniser.steps import RARE, Steps
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import Layers, heights_view

# -------------------------------------------------------------------------------------------------------- recogniser


def strip_of(part: StampedPart) -> Layers:
    boxes = np.array(part.boxes_mm)
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    line = TextLine.straight(x0, 0.5 * (y0 + y1), length_mm=x1 - x0, height_mm=part.height_mm)
    return heights_view(part.height_map).strip(line)


def output(shares: dict[str, float]) -> NDArray[np.float32]:
    """One step of the network, by character; the blank has the rest."""
    power = np.full(1 + len(CHARACTERS), 1e-9)
    for char, value in shares.items():
        power[1 + CHARACTERS.index(char)] = value
    power[0] = 1.0 - sum(shares.values())
    return np.log(power).astype(np.float32)[None]


def blank_and_chars(shares: dict[str, float], chars: str) -> tuple[float, list[float]]:
    steps = steps_of(output(shares), chars=chars)
    return float(np.exp(steps.log_blank[0])), np.exp(steps.log_chars[0]).tolist()


def test_small_letters_count_as_capitals_unless_asked_for() -> None:
    shares = {"K": 0.2, "k": 0.3, "7": 0.1}
    assert blank_and_chars(shares, "K7Q")[1] == pytest.approx([0.5, 0.1, 0.0], abs=1e-5)
    assert blank_and_chars(shares, "Kk")[1] == pytest.approx([0.2, 0.3], abs=1e-5)
    # of characters that it does not know it says nothing
    assert blank_and_chars(shares, "€")[1] == pytest.approx([0.0], abs=1e-5)


def test_what_seldom_stands_on_parts_is_believed_less() -> None:
    steps = steps_of(output({"A": 0.2, ".": 0.4}), chars="A.", rare=".")
    assert np.exp(steps.log_chars[0]) == pytest.approx([0.2, 0.4 * RARE], abs=1e-5)


def test_a_space_is_blank_unless_asked_for() -> None:
    shares = {" ": 0.3, "A": 0.2}
    assert blank_and_chars(shares, "A")[0] == pytest.approx(0.8, abs=1e-5)
    blank, chars = blank_and_chars(shares, "A ")
    assert blank == pytest.approx(0.5, abs=1e-5)
    assert chars == pytest.approx([0.2, 0.3], abs=1e-5)


def test_every_step_of_a_line_has_a_probability_for_each_class(make_part: Callable[..., StampedPart]) -> None:
    strip = strip_of(make_part("K71B", calm=True))
    posterior = posteriors(strip)
    assert posterior.shape == (math.ceil(strip.shape[2] / STEP_COLUMNS), 1 + len(CHARACTERS))
    np.testing.assert_allclose(np.exp(posterior).sum(axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("text", ["K7B29", "HM50R3X8", "42816074"])
def test_a_plate_of_a_font_that_nobody_named_is_read(
    text: str, make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(text)
    steps = steps_of(posteriors(strip_of(part)), chars=ALPHANUMERIC)
    posterior = steps.places((ALPHANUMERIC,) * len(text))
    assert "".join(ALPHANUMERIC[k] for k in posterior.log_belief.argmax(axis=1)) == text
    assert int(steps.count().argmax()) == len(text)
    # places stand where the characters stand, to a fifth of a height
    boxes = np.array(part.boxes_mm)
    middles = (0.5 * (boxes[:, 0] + boxes[:, 2]) - boxes[0, 0]) / part.height_mm
    columns = np.interp(posterior.frame, np.arange(steps.columns.size), steps.columns)
    np.testing.assert_allclose((columns + 0.5) / HEIGHT_ROWS - MARGIN, middles, atol=0.2)


# --------------------------------------------------------------------------------------------------------- read line

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
    assert combine_looks(LINE, looks, None).lattice.text == text
    # of looks that differ the likelier number
    assert combine_looks(LINE, [*looks * 2, steps(text + "A", sure=0.55)], None).lattice.text == text


def test_dirt_that_may_be_any_character_is_none() -> None:
    """All texts with a character there are likelier together than the text without one, but none by itself."""
    gap = steps("A8B", sure=0.99)
    blank, shares = np.exp(gap.log_blank), np.exp(gap.log_chars)
    blank[3], shares[3] = 0.34, 0.22
    line = combine_looks(LINE, [Steps.of(blank, shares, CHARS, gap.columns)], None)
    assert line.lattice.text == "AB"
    assert line.count_probability == pytest.approx(0.34, abs=0.02)
    assert line.open_places[0].text == "AB"


@pytest.mark.parametrize("sure", [0.3, 0.6])
def test_a_number_of_characters_that_the_format_leaves_open_is_only_as_sure_as_it_looks(sure: float) -> None:
    whole = steps("AB8", sure=0.99)
    blank, shares = np.exp(whole.log_blank), np.exp(whole.log_chars)
    blank[-2], shares[-2] = 1.0 - sure, shares[-2] * sure / 0.99
    looks = [Steps.of(blank, shares, CHARS, whole.columns)]
    line = combine_looks(LINE, looks, Grammar.parse("re:[AB8]{2,3}"))
    assert line.lattice.text == ("AB8" if sure > 0.5 else "AB")
    assert line.count_probability == pytest.approx(max(sure, 1.0 - sure), abs=0.02)
    assert combine_looks(LINE, looks, Grammar.parse("re:[AB8]{3}")).count_probability == 1.0


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
