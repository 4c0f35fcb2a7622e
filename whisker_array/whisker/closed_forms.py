"""The paper's closed forms of D11 and T1, eqs. (17) to (21), as print and mechanics have them.

The program itself integrates any chain of segments (`beam`); these are what the integral must come to for
the two whiskers of the paper, frame as in `whisker`.
"""

from __future__ import annotations

import math

import numpy as np

from whisker_array.whisker.sections import Material, Section
from whisker_array.whisker.shapes import Matrix, Vector


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
