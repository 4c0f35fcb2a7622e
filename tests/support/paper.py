"""The paper's closed forms, eqs. (17) to (24), as print and mechanics have them: what the general equations must give.

The program integrates any chain of segments (`whisker_array.whisker.beam`) and takes F from eq. (16)
(`whisker_array.whisker.enhancement`); frame and symbols are theirs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whisker_array.whisker.enhancement import _divide, _lift_and_turn, contact_direction, rotation
from whisker_array.whisker.sections import Material, Section
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


def is_jammed(slope: ArrayLike, mu: float, tip_model: TipModel) -> NDArray[np.bool_]:
    """Find where e_y . D11 (n - mu t) <= 0: no force in the friction cone lifts the tip, so it sticks or snaps."""
    lift, _ = _lift_and_turn(slope, mu, tip_model)
    return np.asarray(lift <= 0.0)
