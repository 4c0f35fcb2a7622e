"""The edge enhancement factor F: the paper's equations in the paper's order.

    y ^                          base o-----.          the whisker is dragged in +x; its base is ahead of and
      |                 beam   ,-'                     above its tip
      |                     ,-'
      |   land           ,-'        n                  alpha > 0: the surface falls in +x
      |  ---------------o          /                   force on the tip: f = f_n (n - mu t) = f_n R a,
      |                  \\ alpha  /                    n the normal, t the tangent towards +x
      |                   \\      /
      +----------------------------------> x

Angles in rad, forces in N, lengths in mm, moments in N mm. F itself has no unit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whisker_array.whisker.sections import WhiskerError

if TYPE_CHECKING:
    from whisker_array.whisker.shapes import TipModel


def _check(alpha_rad: float, mu: float) -> None:
    if not abs(alpha_rad) < math.pi / 2.0:
        raise WhiskerError(
            f"alpha_rad is {alpha_rad}", hint="it must lie between -pi/2 and pi/2 (radians, not degrees)"
        )
    _check_mu(mu)


def _check_mu(mu: float) -> None:
    if not (math.isfinite(mu) and mu >= 0.0):
        raise WhiskerError(f"mu is {mu}", hint="a friction coefficient is finite and not negative")


def _divide(numerator: float, denominator: float, what: str) -> float:
    if denominator == 0.0:
        raise WhiskerError(f"F has no value here: {what}")
    return numerator / denominator


def rotation(alpha_rad: float) -> NDArray[np.float64]:
    """Eq. (9): R(alpha), from surface axes (t1, n, t2) to the world; (3, 3) float64."""
    c, s = math.cos(alpha_rad), math.sin(alpha_rad)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def contact_direction(mu: float) -> NDArray[np.float64]:
    """a of eq. (10) = (-mu, 1, 0): contact force per normal force in surface axes; (3,) float64."""
    _check_mu(mu)
    return np.array([-mu, 1.0, 0.0])


def contact_force(normal_force_n: float, *, alpha_rad: float, mu: float) -> NDArray[np.float64]:
    """Eqs. (8) and (10): f = f_n R a, the force on the sliding tip in world axes; (3,) float64, N."""
    _check(alpha_rad, mu)
    return np.asarray(normal_force_n * (rotation(alpha_rad) @ contact_direction(mu)))


def moment_n_mm(force_n: ArrayLike, tip_model: TipModel) -> float:
    """Eq. (13), with (10) also (14): m = s3 . T1 f, the moment at the sensor about the lateral axis, N mm.

    The tip pushed up behind the base gives a negative moment on the land.
    """
    return float(tip_model.moment_arm_mm @ np.asarray(force_n, dtype=np.float64))


def normal_force_n(tip_model: TipModel, *, lift_mm: float, alpha_rad: float = 0.0, mu: float) -> float:
    """Eqs. (7) and (11): the normal force at which the tip height is what the surface imposes, N.

    f_n = (d0 + h) / (e_y . D11 R a), where lift_mm = d0 + h is how far the surface holds the tip above its
    free path.

    Raises:
        WhiskerError: the whisker jams: no force within the friction cone lifts the tip.
    """
    _check(alpha_rad, mu)
    give = float(tip_model.compliance_mm_per_n[1] @ rotation(alpha_rad) @ contact_direction(mu))
    if give <= 0.0:
        raise WhiskerError(
            (
                f"the whisker jams at alpha = {alpha_rad:.3f} rad, mu = {mu}: the contact force "
                "cannot lift the tip"
            ),
            hint="take a smaller k, or a surface less steep",
        )
    return lift_mm / give


def land_moment_n_mm(tip_model: TipModel, *, preload_mm: float, mu: float) -> float:
    """Eqs. (11) and (14) at alpha = 0, h = 0: the moment on the undisturbed land, N mm (negative)."""
    f_n = normal_force_n(tip_model, lift_mm=preload_mm, mu=mu)
    return moment_n_mm(contact_force(f_n, alpha_rad=0.0, mu=mu), tip_model)


def enhancement_factor(tip_model: TipModel, *, alpha_rad: float, mu: float) -> float:
    """Eq. (16), any whisker: `F = (e_y.D11 R a / e_y.D11 R'a) (s3.T1 R'a / s3.T1 R a)`.

    R = R(0) is the land, R' = R(alpha) the slope.

    Raises:
        WhiskerError: one of the two denominators vanishes (the singular angle, or no moment on the land).
    """
    _check(alpha_rad, mu)
    land = contact_direction(mu)
    slope = rotation(alpha_rad) @ land
    row = tip_model.compliance_mm_per_n[1]
    arm = tip_model.moment_arm_mm
    lift = _divide(float(row @ land), float(row @ slope), "the force on this slope cannot lift the tip")
    turn = _divide(float(arm @ slope), float(arm @ land), "the force on the land makes no moment")
    return lift * turn


def enhancement_l_shaped(
    *, alpha_rad: float, mu: float, k: float, beta_rad: float = 0.0, arm_offset: float = 0.0
) -> float:
    """Eq. (22), the L-shaped whisker at any setting.

    F = [c - (s + o) g(alpha)] / [c - (s + o) g(0)] . [c - (s + 1.5 k) g(0)] / [c - (s + 1.5 k) g(alpha)]

    Args:
        alpha_rad: intersection angle, rad.
        mu: friction coefficient.
        k: l2 / l1.
        beta_rad: setting angle, rad.
        arm_offset: o = (l2 - l3) / l1.

    Raises:
        WhiskerError: a denominator vanishes.
    """
    g, g0 = friction_slope(alpha_rad, mu), friction_slope(0.0, mu)
    c, s = math.cos(beta_rad), math.sin(beta_rad)
    turn = _divide(c - (s + arm_offset) * g, c - (s + arm_offset) * g0, "no moment on the land")
    lift = _divide(c - (s + 1.5 * k) * g0, c - (s + 1.5 * k) * g, "the force cannot lift the tip")
    return turn * lift


def friction_slope(alpha_rad: float, mu: float) -> float:
    """Eq. (23): g = (tan(alpha) - mu) / (1 + mu tan(alpha)) = tan(alpha - atan(mu)), the lean of the force.

    Raises:
        WhiskerError: 1 + mu tan(alpha) = 0, a rising wall on the edge of the friction cone.
    """
    _check(alpha_rad, mu)
    t = math.tan(alpha_rad)
    return _divide(t - mu, 1.0 + mu * t, "the contact force is horizontal")


def enhancement_level(*, alpha_rad: float, mu: float, k: float) -> float:
    """Eq. (24), beta = 0 and l3 = l2: F = [1 - 1.5 k g(0, mu)] / [1 - 1.5 k g(alpha, mu)].

    Raises:
        WhiskerError: alpha is the singular angle.
    """
    return _divide(
        1.0 - 1.5 * k * friction_slope(0.0, mu),
        1.0 - 1.5 * k * friction_slope(alpha_rad, mu),
        "alpha is the singular angle",
    )


def enhancement_level_with_h(*, alpha_rad: float, mu: float, k: float) -> float:
    """Eq. (25): F = (1 + 1.5 k mu) / (1 + 1.5 k h(alpha, mu)).

    The print is right: h = -g exactly, so that (25) is (24). But (26) is 0/0 in form at alpha = 0
    and loses digits near it; compute with (24).

    Raises:
        WhiskerError: alpha is 0 or the singular angle.
    """
    h = h_of_paper(alpha_rad, mu)
    return _divide(1.0 + 1.5 * k * mu, 1.0 + 1.5 * k * h, "alpha is the singular angle")


def h_of_paper(alpha_rad: float, mu: float) -> float:
    """Eq. (26): h = 1/tan(alpha) - (tan(alpha) + 1/tan(alpha)) / (mu tan(alpha) + 1), which is -g of (23).

    (mu t + 1 - t^2 - 1) / (t (mu t + 1)) = (mu - t) / (mu t + 1). Not the surface height h(x, z).

    Raises:
        WhiskerError: alpha = 0, where the form is 0/0 (its limit is mu).
    """
    _check(alpha_rad, mu)
    t = math.tan(alpha_rad)
    what = "eq. (26) is 0/0 at alpha = 0"
    return _divide(1.0, t, what) - _divide(t + _divide(1.0, t, what), mu * t + 1.0, "the force is horizontal")


def enhancement_frictionless(*, alpha_rad: float, k: float) -> float:
    """Eq. (27), mu = 0: F = 1 / (1 - 1.5 k tan(alpha)).

    Raises:
        WhiskerError: alpha is the singular angle.
    """
    _check(alpha_rad, 0.0)
    return _divide(1.0, 1.0 - 1.5 * k * math.tan(alpha_rad), "alpha is the singular angle")


def singular_angle_rad(k: float, *, mu: float = 0.0) -> float:
    """Where F of (24) is singular, rad: alpha_1 = atan(2 / (3 k)) of the paper, plus atan(mu) with friction.

    The paper gives the frictionless angle; with g = tan(alpha - atan mu) friction moves it up. At pi/2 or
    beyond no slope is singular. k = 0 (straight) gives pi/2 + atan(mu).

    Raises:
        WhiskerError: k or mu negative or not finite.
    """
    _check_mu(mu)
    if not (math.isfinite(k) and k >= 0.0):
        raise WhiskerError(f"k is {k}", hint="l2 / l1 is finite and not negative")
    return math.atan2(2.0, 3.0 * k) + math.atan(mu)


def _lift_and_turn(
    slope: ArrayLike, mu: float, tip_model: TipModel
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """e_y.D11 R'a and s3.T1 R'a, both over cos(alpha): R'a = cos(alpha) (-mu - p, 1 - mu p, 0), p = slope."""
    _check_mu(mu)
    p = np.asarray(slope, dtype=np.float64)
    along, up = -mu - p, 1.0 - mu * p
    row, arm = tip_model.compliance_mm_per_n[1], tip_model.moment_arm_mm
    return row[0] * along + row[1] * up, arm[0] * along + arm[1] * up


def moment_ratio(slope: ArrayLike, mu: float, tip_model: TipModel) -> NDArray[np.float64]:
    """Eq. (16) for whole arrays: F at the surface slope dh/dx = -tan(alpha) along the trace.

    Args:
        slope: dh/dx, any shape, dimensionless; positive where the surface rises ahead of the tip.
        mu: friction coefficient.
        tip_model: the whisker.

    Returns:
        float64 of the same shape; 1 on the land, NaN where the whisker jams (see is_jammed) or the
        slope is NaN.

    Raises:
        WhiskerError: the whisker jams on the land already, or the land makes no moment.
    """
    lift, turn = _lift_and_turn(slope, mu, tip_model)
    land_lift, land_turn = (float(v) for v in _lift_and_turn(0.0, mu, tip_model))
    if land_lift <= 0.0 or land_turn == 0.0:
        raise WhiskerError(f"with mu = {mu} the whisker jams, or makes no moment, on the land itself")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (land_lift / land_turn) * turn / lift
    return np.where(lift > 0.0, ratio, np.nan)


def is_jammed(slope: ArrayLike, mu: float, tip_model: TipModel) -> NDArray[np.bool_]:
    """Where e_y . D11 (n - mu t) <= 0: no force in the friction cone lifts the tip, so it sticks or snaps.

    Args and shapes as moment_ratio; False where the slope is NaN.
    """
    lift, _ = _lift_and_turn(slope, mu, tip_model)
    return np.asarray(lift <= 0.0)
