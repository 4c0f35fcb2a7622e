"""Fitting what beliefs are worth: known answers come back, and every way rises."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.learning.fit_calibration import WAYS, Bools, Floats, fit_calibration, loss

SLOPE, BIAS = 0.6, -0.5


def known(n: int = 20_000) -> tuple[Floats, Bools]:
    """Beliefs all over the scale, and texts that are right as often as the known calibration says."""
    rng = np.random.default_rng(3)
    odds = rng.normal(1.0, 3.0, n)
    right = rng.random(n) < 1.0 / (1.0 + np.exp(-(SLOPE * odds + BIAS)))
    return np.asarray(1.0 / (1.0 + np.exp(-odds))), np.asarray(right)


def test_the_calibration_by_which_texts_were_drawn_comes_back() -> None:
    made = fit_calibration(*known())
    # some five standard errors of 20,000 readings
    assert made.slope == pytest.approx(SLOPE, abs=0.04)
    assert made.bias == pytest.approx(BIAS, abs=0.1)


def test_on_the_whole_as_many_are_right_as_it_says() -> None:
    """The surprise is least where the bias has no slope: the mean confidence is the share that is right."""
    beliefs, right = known(2_000)
    made = fit_calibration(beliefs, right)
    said = np.array([made.confidence(belief) for belief in beliefs])
    assert said.mean() == pytest.approx(right.mean(), abs=1e-3)
    assert loss(said, right) < loss(beliefs, right)


@pytest.mark.parametrize("way", WAYS)
def test_every_way_rises_with_the_belief(way: str) -> None:
    beliefs, right = known(2_000)
    said = WAYS[way](beliefs, right, np.linspace(0.001, 0.999, 200))
    assert said.min() >= 0.0
    assert said.max() <= 1.0
    assert (np.diff(said) >= -1e-12).all()


def test_the_ways_that_know_the_form_surprise_less_than_no_way() -> None:
    beliefs, right = known()
    others, others_right = beliefs[::2], right[::2]
    losses = {w: loss(judge(beliefs[1::2], right[1::2], others), others_right) for w, judge in WAYS.items()}
    assert min(losses, key=lambda way: losses[way]) != "as believed"
    assert losses["log odds"] < losses["temperature"] < losses["as believed"]


def test_too_few_wrong_ones_fit_nothing() -> None:
    with pytest.raises(ValueError, match="9 wrong readings are too few"):
        fit_calibration(np.full(100, 0.9), np.arange(100) >= 9)
