"""The paper's closed forms, eqs. (17) to (27), as print and mechanics have them: what the general equations must give.

The program integrates any chain of segments (`whisker_array.whisker.beam`) and takes F from eq. (16)
(`whisker_array.whisker.enhancement`); frame and symbols are theirs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whisker_array.estimation.estimate import _small_root, moment_per_lift
from whisker_array.whisker.enhancement import _divide, _lift_and_turn, contact_direction, rotation
from whisker_array.whisker.sections import Material, Section, WhiskerError
from whisker_array.whisker.shapes import Matrix, TipModel, Vector


def straight_compliance(length_mm: float, beta_rad: float, section: Section, material: Material) -> Matrix:
    """Eq. (17): D11 of an inextensible straight whisker, (3, 3) float64, mm/N; singular along the whisker.

    The print has a round section in mind; for others the lateral term is l^3 / (3 E I_lateral).
    """
    c, s = math.cos(beta_rad), math.sin(beta_rad)
    lateral = section.i_vertical_mm4 / section.i_lateral_mm4
    a = np.array([[s * s, -s * c, 0.0], [-s * c, c * c, 0.0], [0.0, 0.0, lateral]])
    return np.asarray(length_mm**3 / (3.0 * material.e_mpa * section.i_vertical_mm4) * a)


def straight_moment_arm(length_mm: float, beta_rad: float) -> Vector:
    """Eq. (18), third row of T1: l (s, -c, 0), (3,) float64, mm.

    The printed row is that of a tip behind and below the base: base ahead of and above the tip.
    """
    return length_mm * np.array([math.sin(beta_rad), -math.cos(beta_rad), 0.0])


def l_shaped_compliance(
    l1_mm: float, l2_mm: float, beta_rad: float, section: Section, material: Material
) -> Matrix:
    """Eqs. (19) and (20), corrected: D11 = l1^3 / (3 E I) A, inextensible L-shaped whisker, (3, 3), mm/N.

    The print is wrong in two terms (physics.md). Castigliano, with k = l2 / l1 and I, I' for
    vertical and lateral bending::

        A11 = s^2 + 3 k s + 3 k^2 + k^3                              printed: s^2 + 1.5 k s + k^3
        A12 = -s c - 1.5 k c                                         as printed
        A22 = c^2                                                    as printed
        A33 = I/I' (1 + 3 k s + 3 k^2 s^2 + k^3) + 3 k^2 c^2 EI/GJ   printed: without the two s terms, I = I'

    A lateral force at the tip has the arm u + l2 s about the in-plane axis across l1 and twists l1 by l2 c:
    hence the s terms. With the printed A11 the matrix is not positive definite at beta = 0. F is
    untouched: it uses row y only.
    """
    c, s = math.cos(beta_rad), math.sin(beta_rad)
    k = l2_mm / l1_mm
    ei = material.e_mpa * section.i_vertical_mm4
    gj = material.g_mpa * section.j_mm4
    a11 = s * s + 3.0 * k * s + 3.0 * k * k + k**3
    a12 = -s * c - 1.5 * k * c
    bend = 1.0 + 3.0 * k * s + 3.0 * k * k * s * s + k**3
    a33 = section.i_vertical_mm4 / section.i_lateral_mm4 * bend + 3.0 * k * k * c * c * ei / gj
    a = np.array([[a11, a12, 0.0], [a12, c * c, 0.0], [0.0, 0.0, a33]])
    return np.asarray(l1_mm**3 / (3.0 * ei) * a)


def l_shaped_moment_arm(l1_mm: float, l2_mm: float, l3_mm: float, beta_rad: float) -> Vector:
    """Eq. (21), third row of T1: (l1 s + l2 - l3, -l1 c, 0), (3,) float64, mm; frame as in eq. (18)."""
    return np.array([l1_mm * math.sin(beta_rad) + l2_mm - l3_mm, -l1_mm * math.cos(beta_rad), 0.0])


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
    rotation(alpha_rad), contact_direction(mu)  # refuse what is out of range
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
    rotation(alpha_rad), contact_direction(mu)  # refuse what is out of range
    t = math.tan(alpha_rad)
    what = "eq. (26) is 0/0 at alpha = 0"
    return _divide(1.0, t, what) - _divide(t + _divide(1.0, t, what), mu * t + 1.0, "the force is horizontal")


def enhancement_frictionless(*, alpha_rad: float, k: float) -> float:
    """Eq. (27), mu = 0: F = 1 / (1 - 1.5 k tan(alpha)).

    Raises:
        WhiskerError: alpha is the singular angle.
    """
    rotation(alpha_rad)  # refuses what is out of range
    return _divide(1.0, 1.0 - 1.5 * k * math.tan(alpha_rad), "alpha is the singular angle")


def singular_angle_rad(k: float, *, mu: float = 0.0) -> float:
    """Where F of (24) is singular, rad: alpha_1 = atan(2 / (3 k)) of the paper, plus atan(mu) with friction.

    The paper gives the frictionless angle; with g = tan(alpha - atan mu) friction moves it up. At pi/2 or
    beyond no slope is singular. k = 0 (straight) gives pi/2 + atan(mu).

    Raises:
        WhiskerError: k or mu negative or not finite.
    """
    contact_direction(mu)  # refuses what is out of range
    if not (math.isfinite(k) and k >= 0.0):
        raise WhiskerError(f"k is {k}", hint="l2 / l1 is finite and not negative")
    return math.atan2(2.0, 3.0 * k) + math.atan(mu)


def lift_from_slope(
    moment_n_mm: ArrayLike, slope: ArrayLike, tip: TipModel, *, mu: float
) -> NDArray[np.float64]:
    """Eqs. (11) and (14) solved for the lift d0 + h, mm, at a slope dh/dx; NaN where it would jam."""
    theta = np.arctan(np.asarray(slope, dtype=np.float64)) + np.arctan(mu)
    theta = np.where(np.abs(theta) < np.pi / 2.0, theta, np.nan)
    return np.asarray(moment_n_mm, dtype=np.float64) / moment_per_lift(theta, tip)


def slope_from_turned(
    one_n_mm: ArrayLike, turned_n_mm: ArrayLike, tip: TipModel, *, mu: float
) -> NDArray[np.float64]:
    """Slope dh/dx where one differentiator passed dragged both ways, turned about between; no lift needed.

    q = G(tau + phi) / G(-tau + phi) is a quadratic in tan(tau). (Dragged and *pushed* will not do: that quotient
    rises and falls again with tau, so two slopes answer to it.)

    Args:
        one_n_mm: moment with the base ahead in +x.
        turned_n_mm: moment with the base ahead in -x.
        tip: the differentiator.
        mu: friction.

    Returns:
        dh/dx = tan(tau), the broadcast shape; NaN where the moments fit no slope.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.asarray(one_n_mm, dtype=np.float64) / np.asarray(turned_n_mm, dtype=np.float64)
    row, arm = tip.compliance_mm_per_n[1], tip.moment_arm_mm
    # m = lift (a - b p) / (c - e p) one way, p = -p the other: R'a ~ (-mu - p, 1 - mu p)
    a, b = arm[1] - arm[0] * mu, arm[1] * mu + arm[0]
    c, e = row[1] - row[0] * mu, row[1] * mu + row[0]
    return _small_root(b * e * (q - 1.0), (a * e - b * c) * (1.0 + q), a * c * (1.0 - q))


def is_jammed(slope: ArrayLike, mu: float, tip_model: TipModel) -> NDArray[np.bool_]:
    """Find where e_y . D11 (n - mu t) <= 0: no force in the friction cone lifts the tip, so it sticks or snaps."""
    lift, _ = _lift_and_turn(slope, mu, tip_model)
    return np.asarray(lift <= 0.0)
