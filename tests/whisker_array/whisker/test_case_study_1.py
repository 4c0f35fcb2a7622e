"""Sec. 3.5 of the paper: a straight whisker has F = 1 for any angle, setting and friction, and feels the profile."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.factories import extruded
from whisker_array.simulation.contact import trace_contact
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.surface import prepare_surface
from whisker_array.whisker.enhancement import contact_direction, enhancement_factor, is_jammed, rotation
from whisker_array.whisker.sections import MUSIC_WIRE, Round
from whisker_array.whisker.shapes import straight_whisker

L = 30.0
WIRE = Round(0.3)
D0 = 1.0
BENDING = 3.0 * MUSIC_WIRE.e_mpa * WIRE.i_vertical_mm4 / L**3
"""Force over deflection across the whisker, N/mm."""
AXIAL_SHARE = 3.0 * WIRE.i_vertical_mm4 / (WIRE.area_mm2 * L**2)
"""Compliance along the whisker over that across it: 1.9e-5, all that (17) leaves out."""
FLOAT32 = 2e-5
"""Relative: heights of 1 mm in float32 make slopes uncertain by 1e-6, doubled where the wall is steep."""
EXACT = 1e-9

ANGLES = st.floats(-1.05, 1.05)
SETTINGS = st.floats(-0.5, 1.2)
FRICTIONS = st.floats(0.0, 0.8)


def lean(alpha: float, beta: float, mu: float) -> tuple[float, float]:
    """The contact force R a along and across the whisker."""
    force = rotation(alpha) @ contact_direction(mu)
    along = float(force @ [math.cos(beta), math.sin(beta), 0.0])
    across = float(force @ [-math.sin(beta), math.cos(beta), 0.0])
    return along, across


@settings(max_examples=100, deadline=None)
@given(alpha=ANGLES, beta=SETTINGS, mu=FRICTIONS)
def test_f_is_1_but_for_the_axial_term(alpha: float, beta: float, mu: float) -> None:
    """D11 = n n^T + e a a^T: F = (1 + e tan(beta) q(0)) / (1 + e tan(beta) q(alpha)), q = along / across."""
    along_land, across_land = lean(0.0, beta, mu)
    along, across = lean(alpha, beta, mu)
    # where the force points along the whisker or under it, nothing but its axial give could lift the tip: it jams
    assume(min(across, across_land) > 0.02)
    tip = straight_whisker(L, beta, WIRE).tip_model()
    factor = enhancement_factor(tip, alpha_rad=alpha, mu=mu)
    e_tan = AXIAL_SHARE * math.tan(beta)
    q_land, q = along_land / across_land, along / across
    assert factor == pytest.approx((1.0 + e_tan * q_land) / (1.0 + e_tan * q), rel=EXACT)
    # to first order; the second is AXIAL_SHARE tan(beta) q, under 1 %, of the first
    assert abs(factor - 1.0) <= 1.02 * abs(e_tan * (q_land - q)) + EXACT
    assert not is_jammed(-math.tan(alpha), mu, tip)


@settings(max_examples=100, deadline=None)
@given(alpha=ANGLES, beta=SETTINGS, mu=FRICTIONS)
def test_it_jams_where_the_force_cannot_bend_it_up(alpha: float, beta: float, mu: float) -> None:
    across = lean(alpha, beta, mu)[1]
    assume(abs(across) > 0.02)
    assert is_jammed(-math.tan(alpha), mu, straight_whisker(L, beta, WIRE).tip_model()) == (across < 0.0)


@settings(max_examples=25, deadline=None)
@given(beta=st.floats(-0.3, 0.9), steepness=st.floats(0.0, 1.0), seed=st.integers(0, 1000))
def test_the_moment_is_the_profile_whatever_the_friction(beta: float, steepness: float, seed: int) -> None:
    """m = -3 E I / (l^2 cos(beta)) (d0 + h): the friction is nowhere in it, and is drawn anew for every sample."""
    rng = np.random.default_rng(seed)
    h = (0.01 * np.cumsum(steepness * rng.uniform(-1.0, 1.0, 80))).astype(np.float32)[None]
    mu = rng.uniform(0.0, 0.6, h.shape).astype(np.float32)
    p = np.gradient(h[0].astype(np.float64), 0.01)
    across = np.cos(beta) * (1.0 - mu[0] * p) + np.sin(beta) * (p + mu[0])
    assume(float(across.min()) > 0.3)
    assume(float(h.min()) > -0.8)
    tip = straight_whisker(L, beta, WIRE).tip_model()
    felt = trace_pointwise(h, tip, step_mm=0.01, preload_mm=D0, friction=mu)
    assert not felt.flags.any()
    # tan(beta) <= 1.3 and q <= |f| / 0.3 <= 6: the axial term counts at most 8 times
    np.testing.assert_allclose(
        felt.moment_n_mm, -BENDING * L / math.cos(beta) * (D0 + h), rtol=8.0 * AXIAL_SHARE + FLOAT32
    )


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
def test_in_contact_as_well(mu: float) -> None:
    step = 0.01
    x = np.arange(600) * step
    h = 0.2 * np.sin(2.1 * x) + 0.1 * np.sin(7.3 * x + 1.0) - 0.1
    surface = prepare_surface(extruded(h, rows=3, pitch_mm=step), friction=mu)
    tip = straight_whisker(L, 0.0, WIRE).tip_model()
    felt = trace_contact(
        surface, tip, lines_mm=np.array([step]), start_mm=0.0, step_mm=step, n_samples=x.size,
        preload_mm=D0, nominal_friction=mu,
    )  # fmt: skip
    assert not felt.flags.any()
    inside = slice(2, -2)
    # along the trace the wire gives 5e4 times less than in height: the tip is where it is commanded to be, within
    # the solver's 5e-4 of a step and the give of 1e-5 mm, on slopes up to 1.2
    np.testing.assert_allclose(felt.moment_n_mm[0, inside], (-BENDING * L * (D0 + h))[inside], rtol=1e-4)
