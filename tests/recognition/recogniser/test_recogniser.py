"""The recogniser: what becomes of its classes, and that it reads a font that nobody named."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.stamping.stamp import StampedPart
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.recogniser import CHARACTERS, STEP_COLUMNS, posteriors, steps_of
from recognition.recogniser.steps import RARE
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import Layers, heights_view


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


def test_every_step_of_a_line_has_a_probability_for_each_class(
    make_part: Callable[..., StampedPart],
) -> None:
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
