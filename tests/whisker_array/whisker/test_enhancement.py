"""The paper's equations against each other, against the known answers of physics.md, and case study 1."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.factories import extruded
from tests.support.paper import enhancement_l_shaped, enhancement_level, is_jammed
from tests.support.trace_frame import trace_contact
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.surface import prepare_surface
from whisker_array.whisker.enhancement import (
    contact_direction,
    contact_force,
    enhancement_factor,
    land_moment_n_mm,
    moment_n_mm,
    moment_ratio,
    normal_force_n,
    rotation,
)
from whisker_array.whisker.sections import MUSIC_WIRE, Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import LShaped, TipModel, straight_whisker

# ------------------------------------------------------------------------------------------------------- enhancement

MUS = (0.0, 0.1, 0.3, 0.5)
ALPHAS_DEG = (30, 45, 60)
KNOWN = {
    0.033: ((1.029, 1.052, 1.094), (1.028, 1.047, 1.079), (1.027, 1.043, 1.065), (1.028, 1.042, 1.059)),
    0.083: ((1.077, 1.142, 1.275), (1.073, 1.127, 1.225), (1.069, 1.112, 1.175), (1.070, 1.108, 1.157)),
    0.117: ((1.113, 1.213, 1.437), (1.105, 1.188, 1.346), (1.098, 1.163, 1.261), (1.099, 1.155, 1.230)),
}
CASES = [
    (k, mu, math.radians(alpha), KNOWN[k][i][j])
    for k in KNOWN
    for i, mu in enumerate(MUS)
    for j, alpha in enumerate(ALPHAS_DEG)
]
alphas = st.floats(-1.05, 1.05)
mus = st.floats(0.0, 0.5)


def level(k: float, *, axial: bool = False) -> TipModel:
    return LShaped(30.0, 30.0 * k, None, 0.0, Rectangle(0.3, 4.5)).tip_model(axial=axial)


@pytest.mark.parametrize(("k", "mu", "alpha", "known"), CASES)
def test_known_answers(k: float, mu: float, alpha: float, known: float) -> None:
    # half a unit of the third decimal, and the rounding of the table itself
    for found in (
        enhancement_factor(level(k, axial=True), alpha_rad=alpha, mu=mu),
        enhancement_factor(level(k), alpha_rad=alpha, mu=mu),
        enhancement_l_shaped(alpha_rad=alpha, mu=mu, k=k),
        enhancement_level(alpha_rad=alpha, mu=mu, k=k),
        float(moment_ratio(-math.tan(alpha), mu, level(k, axial=True))),
    ):
        assert found == pytest.approx(known, abs=5.5e-4)


@given(alpha=alphas, mu=mus, k=st.floats(0.0, 0.2))
def test_eq_24_is_eq_16(alpha: float, mu: float, k: float) -> None:
    assume(k == 0.0 or k > 1e-6)
    whisker = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4)).tip_model(axial=k == 0.0)
    general = enhancement_factor(whisker, alpha_rad=alpha, mu=mu)
    assert enhancement_level(alpha_rad=alpha, mu=mu, k=k) == pytest.approx(general, rel=1e-9)


@given(alpha=alphas, mu=mus, beta=st.floats(0.0, 0.3), k=st.floats(0.01, 0.2), l3=st.floats(0.0, 4.0))
def test_eq_22_is_eq_16(alpha: float, mu: float, beta: float, k: float, l3: float) -> None:
    model = LShaped(30.0, 30.0 * k, l3, beta, Rectangle(0.3, 1.8)).tip_model(axial=False)
    closed = enhancement_l_shaped(alpha_rad=alpha, mu=mu, k=k, beta_rad=beta, arm_offset=k - l3 / 30.0)
    general = enhancement_factor(model, alpha_rad=alpha, mu=mu)
    assert closed == pytest.approx(general, rel=1e-7)


def test_rotation_and_force() -> None:
    r = rotation(0.4)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-15)
    # alpha > 0 falls in +x, so its normal leans forward; friction on the tip points back against the trace
    normal, tangent = r @ [0.0, 1.0, 0.0], r @ [1.0, 0.0, 0.0]
    assert normal[0] > 0.0 > tangent[1]
    np.testing.assert_allclose(contact_force(2.0, alpha_rad=0.4, mu=0.3), 2.0 * (normal - 0.3 * tangent))
    np.testing.assert_array_equal(contact_direction(0.25), [-0.25, 1.0, 0.0])


@given(alpha=alphas, mu=mus)
def test_f_is_the_ratio_of_moments_at_one_height(alpha: float, mu: float) -> None:
    # eq. (15) from the forces of (11), rather than from (16)
    model = level(0.117)
    force = normal_force_n(model, lift_mm=0.7, alpha_rad=alpha, mu=mu)
    moment = moment_n_mm(contact_force(force, alpha_rad=alpha, mu=mu), model)
    ratio = moment / land_moment_n_mm(model, preload_mm=0.7, mu=mu)
    assert ratio == pytest.approx(enhancement_factor(model, alpha_rad=alpha, mu=mu), rel=1e-12)
    lift = model.compliance_mm_per_n @ contact_force(force, alpha_rad=alpha, mu=mu)
    assert lift[1] == pytest.approx(0.7)


def test_moment_ratio_keeps_shape_and_marks_jams() -> None:
    model = level(0.117)
    slope = np.array([[0.0, -1.0, 1.0], [-20.0, 5.0, np.nan]], dtype=np.float32)
    ratio = moment_ratio(slope, 0.5, model)
    jam = is_jammed(slope, 0.5, model)
    assert ratio.shape == slope.shape
    assert ratio.dtype == np.float64
    assert ratio[0, 0] == 1.0
    assert ratio[0, 1] > 1.0 > ratio[0, 2]
    assert jam.tolist() == [[False, False, False], [False, True, False]]
    assert np.isnan(ratio[1, 1:]).all()
    for p, f in zip(slope[0], ratio[0], strict=True):
        expected = enhancement_factor(model, alpha_rad=-math.atan(float(p)), mu=0.5)
        assert f == pytest.approx(expected, rel=1e-12)


def test_refusals_say_what_is_wrong() -> None:
    model = level(0.117)
    with pytest.raises(WhiskerError, match="radians"):
        rotation(45.0)
    with pytest.raises(WhiskerError, match=r"mu is -0\.1"):
        contact_direction(-0.1)
    with pytest.raises(WhiskerError, match="jams"):
        normal_force_n(model, lift_mm=1.0, alpha_rad=-1.3, mu=0.5)
    backwards = LShaped(30.0, 3.0, None, -1.4, Rectangle(0.3, 4.5)).tip_model()
    with pytest.raises(WhiskerError, match="on the land itself"):
        moment_ratio(0.0, 0.5, backwards)
    no_arm = TipModel(np.eye(3), np.array([1.0, 0.0, 0.0]))
    with pytest.raises(WhiskerError, match="no moment"):
        enhancement_factor(no_arm, alpha_rad=0.1, mu=0.0)


# ------------------------------------------------------------------------------------------------------ case study 1

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


@settings(max_examples=40, deadline=None)
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


@settings(max_examples=40, deadline=None)
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
