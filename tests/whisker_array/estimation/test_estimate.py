"""From moments back to lift, slope and friction: round trips through the equations forward."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.support.paper import is_jammed
from whisker_array.estimation.estimate import (
    friction_from_shapes,
    friction_from_two_ways,
    is_profiler,
    lean_from_moment,
    lift_from_profiler,
    moment_per_lift,
    tip_shift_mm,
)
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.whisker.enhancement import land_moment_n_mm, moment_ratio, rotation
from whisker_array.whisker.sections import Rectangle, WhiskerError
from whisker_array.whisker.shapes import LShaped, TipModel, straight_whisker

RIBBON = Rectangle(0.3, 4.5)
EXACT = 1e-6
"""Forward and back in double precision: 1e-16, times the condition of the weakest k (1 / 1.5 k^2), and to spare."""

ks = st.floats(0.03, 0.25)
betas = st.floats(0.0, 0.5)
frictions = st.floats(0.0, 0.5)
slopes = st.floats(-1.2, 1.2)
preloads = st.floats(0.2, 3.0)


def l_shaped(k: float, beta: float, l3_over_l2: float = 1.0, *, axial: bool = False) -> TipModel:
    """Inextensible unless asked otherwise: then eq. (22) is exact, and so is l3 = -l2 / 2."""
    whisker = LShaped(30.0, 30.0 * k, 30.0 * k * l3_over_l2, beta, RIBBON)
    return whisker.tip_model(axial=axial)


def felt(slope: float, mu: float, tip: TipModel, lift_mm: float) -> float:
    """Moment at a lift, by (16) and the land's: m = m_land (lift / d0) F, N mm; a jammed case is thrown away."""
    assume(not is_jammed(0.0, mu, tip))
    assume(not is_jammed(slope, mu, tip))
    ratio = float(moment_ratio(slope, mu, tip))
    return land_moment_n_mm(tip, preload_mm=lift_mm, mu=mu) * ratio


@given(ks, betas, st.floats(0.0, 1.5), slopes, frictions, preloads)
def test_the_lean_comes_back(
    k: float, beta: float, l3: float, slope: float, mu: float, lift_mm: float
) -> None:
    tip = l_shaped(k, beta, l3)
    theta = lean_from_moment(felt(slope, mu, tip, lift_mm), lift_mm, tip)
    assert float(theta) == pytest.approx(math.atan(slope) + math.atan(mu), abs=EXACT)


@given(ks, betas, frictions, preloads)
def test_friction_comes_back_from_both_shapes(k: float, beta: float, mu: float, lift_mm: float) -> None:
    one, other = l_shaped(k, beta), l_shaped(k, beta, -0.5)
    moments = felt(0.0, mu, one, lift_mm), felt(0.0, mu, other, lift_mm)
    found = friction_from_shapes(*moments, differentiator=one, profiler=other)
    assert float(found) == pytest.approx(mu, abs=EXACT)


@given(ks, betas, st.floats(0.0, 1.5), frictions, preloads, st.floats(0.5, 2.0))
def test_friction_comes_back_from_two_ways_whatever_the_gain(
    k: float, beta: float, l3: float, mu: float, lift_mm: float, gain: float
) -> None:
    tip = l_shaped(k, beta, l3)
    dragged, pushed = felt(0.0, mu, tip, lift_mm), felt(0.0, mu, tip.pushed(), lift_mm)
    assert float(friction_from_two_ways(gain * dragged, gain * pushed, tip)) == pytest.approx(mu, abs=EXACT)


@given(ks, betas, slopes, frictions, preloads)
def test_a_profiler_gives_the_lift_whatever_slope_and_friction(
    k: float, beta: float, slope: float, mu: float, lift_mm: float
) -> None:
    tip = l_shaped(k, beta, -0.5)
    assert float(lift_from_profiler(felt(slope, mu, tip, lift_mm), tip)) == pytest.approx(lift_mm)


# Steeper, the axial term of D11 is no longer small beside the bending, and below -45 degrees theta = 45 degrees jams.
@given(st.floats(math.radians(-35.0), math.radians(75.0)))
def test_a_straight_whisker_is_a_profiler(beta: float) -> None:
    assert is_profiler(straight_whisker(30.0, beta, RIBBON).tip_model())


@given(st.floats(0.01, 0.5), st.floats(math.radians(-30.0), math.radians(60.0)))
def test_a_sensor_raised_by_half_the_tip_arm_makes_a_profiler(k: float, beta: float) -> None:
    assert is_profiler(l_shaped(k, beta, -0.5, axial=True))


@given(st.floats(0.01, 0.5), st.floats(0.0, math.radians(60.0)))
def test_the_usual_sensor_makes_a_differentiator(k: float, beta: float) -> None:
    assert not is_profiler(l_shaped(k, beta, axial=True))


def factor(tip: TipModel, *, alpha_rad: float, mu: float) -> float:
    """Eq. (16) as printed, for any sign of mu."""
    land = np.array([-mu, 1.0, 0.0])
    slope = rotation(alpha_rad) @ land
    row, arm = tip.compliance_mm_per_n[1], tip.moment_arm_mm
    return float((row @ land) / (row @ slope) * (arm @ slope) / (arm @ land))


@given(ks, betas, st.floats(-0.5, 1.5), slopes, frictions)
def test_pushed_is_friction_with_the_other_sign(
    k: float, beta: float, l3: float, slope: float, mu: float
) -> None:
    tip = l_shaped(k, beta, l3)
    assume(not is_jammed(slope, mu, tip.pushed()))
    assume(not is_jammed(0.0, mu, tip.pushed()))
    # `slope` is that of the travel, which is the whisker's own -x: there the surface falls by it
    ours = float(moment_ratio(slope, mu, tip.pushed()))
    assert ours == pytest.approx(factor(tip, alpha_rad=math.atan(slope), mu=-mu), rel=1e-9)


@given(ks, betas, slopes, frictions, preloads)
def test_the_tip_is_bent_as_its_compliance_says(
    k: float, beta: float, slope: float, mu: float, lift_mm: float
) -> None:
    tip = l_shaped(k, beta)
    assume(not is_jammed(slope, mu, tip))
    theta = math.atan(slope) + math.atan(mu)
    bent = tip.compliance_mm_per_n @ np.array([-math.sin(theta), math.cos(theta), 0.0])
    expected = lift_mm * bent[0] / bent[1]
    assert float(tip_shift_mm(theta, lift_mm, tip)) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_on_the_land_the_tip_lags_by_what_the_contact_takes_off() -> None:
    tip = l_shaped(0.117, 0.3)
    lag = land_lag_mm(tip, preload_mm=1.0, friction=0.2)
    assert float(tip_shift_mm(math.atan(0.2), 1.0, tip)) == pytest.approx(lag, rel=1e-9)


def test_what_cannot_be_is_nan_and_leaves_its_neighbours_alone() -> None:
    tip = l_shaped(0.117, 0.0)
    # beta = 0: a dragged tip jams beyond tan(theta) = -1 / (1.5 k), 80 degrees of falling wall
    assert np.isnan(moment_per_lift(math.radians(-81.0), tip))
    land = float(moment_per_lift(0.0, tip))
    theta = lean_from_moment(np.array([land, 0.0, -land, np.nan]), 1.0, tip)
    np.testing.assert_array_equal(np.isfinite(theta), [True, False, False, False])
    assert theta[0] == pytest.approx(0.0, abs=1e-12)


def test_the_wrong_whisker_is_refused() -> None:
    profiler, differentiator = l_shaped(0.117, 0.0, -0.5), l_shaped(0.117, 0.0)
    with pytest.raises(WhiskerError, match="is not a profiler"):
        lift_from_profiler(-5.0, differentiator)
    with pytest.raises(WhiskerError, match="is not a profiler"):
        friction_from_shapes(-5.0, -5.0, differentiator=differentiator, profiler=differentiator)
    with pytest.raises(WhiskerError, match="does not measure the slope"):
        lean_from_moment(-5.0, 1.0, profiler)
    with pytest.raises(WhiskerError, match="same both ways"):
        friction_from_two_ways(-5.0, -5.0, profiler)
