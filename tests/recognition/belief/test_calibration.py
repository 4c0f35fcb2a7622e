"""What a belief is worth: rising, undone by its opposite, and the same at the ends."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.belief.calibration import (
    SOURCES,
    Calibration,
    calibration_of,
    shrunk,
)

SLOPES, BIASES = st.floats(0.2, 5.0), st.floats(-3.0, 3.0)
SHARES = st.floats(1e-6, 1.0 - 1e-6)


@given(SHARES)
def test_without_slope_and_bias_a_belief_is_a_confidence(belief: float) -> None:
    # two logarithms and an exponential: some rounding
    assert Calibration().confidence(belief) == pytest.approx(belief, rel=1e-9)


@given(SLOPES, BIASES, SHARES, SHARES)
def test_it_rises_and_is_undone(slope: float, bias: float, one: float, other: float) -> None:
    made = Calibration(slope, bias)
    low, high = sorted((one, other))
    assert 0.0 <= made.confidence(low) <= made.confidence(high) <= 1.0
    said = made.confidence(one)
    if 1e-9 < said < 1.0 - 1e-9:  # nearer to the ends the digits of a float are used up
        assert made.belief(said) == pytest.approx(one, rel=1e-4)


@given(SLOPES, BIASES)
def test_what_is_certain_stays_certain(slope: float, bias: float) -> None:
    made = Calibration(slope, bias)
    assert (made.confidence(0.0), made.confidence(1.0)) == (0.0, 1.0)


def test_a_temperature_is_a_power_of_the_odds() -> None:
    # odds 9 to 1, to the power of a half: 3 to 1
    assert Calibration(slope=0.5).confidence(0.9) == pytest.approx(0.75)
    assert Calibration(bias=-math.log(9.0)).confidence(0.9) == pytest.approx(0.5)


@pytest.mark.parametrize(("slope", "bias"), [(0.0, 0.0), (-1.0, 0.0), (math.nan, 0.0), (1.0, math.inf)])
def test_what_does_not_rise_is_none(slope: float, bias: float) -> None:
    with pytest.raises(ValueError, match="is no calibration"):
        Calibration(slope, bias)


@pytest.mark.parametrize("source", SOURCES)
def test_every_source_has_one(source: str) -> None:
    assert 0.3 < calibration_of(source).slope < 2.0


@given(SHARES, st.floats(0.0, 20.0))
def test_off_the_ground_odds_shrink_and_no_order_changes(confidence: float, widths: float) -> None:
    said = shrunk(confidence, widths)
    assert abs(said - 0.5) <= abs(confidence - 0.5) + 1e-12
    assert (said - 0.5) * (confidence - 0.5) >= 0.0
    # odds 81 to 1, one width off: 9 to 1
    assert shrunk(81.0 / 82.0, 1.0) == pytest.approx(0.9)


def test_how_far_off_the_ground_is_told_in_its_widths() -> None:
    made = Calibration(ground={"ROUGH": (2.0, 4.0), "FELT": (0.5, 1.0)})
    assert made.off({"ROUGH": 3.0, "FELT": 0.75}) == made.off({"WEIGHT": 9.0}) == made.off({}) == 0.0
    assert made.off({"ROUGH": 5.0, "FELT": 0.25}) == pytest.approx(0.5)
    assert made.off({"ROUGH": -2.0}) == pytest.approx(2.0)
    with pytest.raises(ValueError, match="no width in ROUGH"):
        Calibration(ground={"ROUGH": (2.0, 2.0)})
