"""The paper's equations against each other and against the known answers of physics.md."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.support.paper import (
    enhancement_frictionless,
    enhancement_l_shaped,
    enhancement_level,
    enhancement_level_with_h,
    friction_slope,
    h_of_paper,
    singular_angle_rad,
)
from whisker_array.whisker.enhancement import (
    contact_direction,
    contact_force,
    enhancement_factor,
    is_jammed,
    land_moment_n_mm,
    moment_n_mm,
    moment_ratio,
    normal_force_n,
    rotation,
)
from whisker_array.whisker.sections import Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import LShaped, TipModel

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
        enhancement_level_with_h(alpha_rad=alpha, mu=mu, k=k),
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


@given(alpha=alphas, mu=mus, beta=st.floats(-0.5, 0.5))
def test_straight_whisker_is_a_profilometer(alpha: float, mu: float, beta: float) -> None:
    g = math.tan(alpha - math.atan(mu))
    assume(abs(math.cos(beta) - math.sin(beta) * g) > 0.1 and abs(alpha - math.atan(mu)) < 1.5)
    assert enhancement_l_shaped(alpha_rad=alpha, mu=mu, k=0.0, beta_rad=beta) == pytest.approx(1.0, rel=1e-12)
    # with the axial term of a beam: test_case_study_1.py


@given(alpha=alphas, mu=mus)
def test_g_is_the_tangent_less_the_friction_angle(alpha: float, mu: float) -> None:
    assume(abs(abs(alpha - math.atan(mu)) - math.pi / 2) > 1e-3)
    expected = math.tan(alpha - math.atan(mu))
    assert friction_slope(alpha, mu) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@given(alpha=alphas, mu=mus)
def test_h_of_the_print_is_minus_g(alpha: float, mu: float) -> None:
    assume(abs(alpha) > 1e-3 and abs(1 + mu * math.tan(alpha)) > 1e-2)
    assert h_of_paper(alpha, mu) == pytest.approx(-friction_slope(alpha, mu), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_eq_27_is_eq_24_without_friction(alpha: float) -> None:
    expected = enhancement_level(alpha_rad=alpha, mu=0.0, k=0.117)
    assert enhancement_frictionless(alpha_rad=alpha, k=0.117) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_singular_angle(mu: float) -> None:
    k = 0.8
    alpha = singular_angle_rad(k, mu=mu)
    assert math.tan(singular_angle_rad(k)) == pytest.approx(2 / (3 * k))
    assert 1.0 - 1.5 * k * friction_slope(alpha, mu) == pytest.approx(0.0, abs=1e-12)
    below = enhancement_level(alpha_rad=alpha - 1e-6, mu=mu, k=k)
    above = enhancement_level(alpha_rad=alpha + 1e-6, mu=mu, k=k)
    assert below > 1e5
    assert above < -1e5
    assert singular_angle_rad(0.0) == pytest.approx(math.pi / 2)
    jam = is_jammed([-math.tan(alpha - 1e-6), -math.tan(alpha + 1e-6)], mu, level(k))
    assert jam.tolist() == [False, True]


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
        friction_slope(45.0, 0.1)
    with pytest.raises(WhiskerError, match=r"mu is -0\.1"):
        contact_direction(-0.1)
    with pytest.raises(WhiskerError, match="0/0"):
        h_of_paper(0.0, 0.1)
    with pytest.raises(WhiskerError, match="k is"):
        singular_angle_rad(-1.0)
    with pytest.raises(WhiskerError, match="jams"):
        normal_force_n(model, lift_mm=1.0, alpha_rad=-1.3, mu=0.5)
    backwards = LShaped(30.0, 3.0, None, -1.4, Rectangle(0.3, 4.5)).tip_model()
    with pytest.raises(WhiskerError, match="on the land itself"):
        moment_ratio(0.0, 0.5, backwards)
    no_arm = TipModel(np.eye(3), np.array([1.0, 0.0, 0.0]))
    with pytest.raises(WhiskerError, match="no moment"):
        enhancement_factor(no_arm, alpha_rad=0.1, mu=0.0)
