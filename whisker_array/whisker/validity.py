"""Deflection and frequency of a whisker in use, and the limits of the paper's assumptions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from glyphs.ranges import Range, require_range
from glyphs.surface.display import OneLine
from whisker_array.whisker import enhancement
from whisker_array.whisker.beam import Matrix, Vector, cross_matrix
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import Whisker

DEFLECTION_LIMIT = 0.1
"""Largest tip deflection over l1 under Assumption 1."""
LINEAR_ERROR_LIMIT = 0.02
"""Largest error of the linear beam's force or moment, as a share of the exact one. It matches the paper's own limit:
for its whisker, a 0.3 mm wire with k = 1/12 bent by 10 % of l1, the force is wrong by 1.8 %. It is also below the 3 %
by which the gains of real whiskers differ, so the beam is not the largest error of the sensor."""
PRELOAD_MARGIN = 1.2
"""Least ratio of preload to mark depth that keeps contact on the groove floor (Assumption 3)."""
QUASI_STATIC_SHARE = 0.1
"""Largest ratio of signal frequency to first bending frequency (Assumption 5). The error of a sine is then 1 %. That
of an edge map is 2 to 3 % at walls of 45 degrees and 6 to 9 % at 60 degrees, because the corners of a groove contain
higher frequencies (`tests.proof.dynamic`). A design search needs this limit because it cannot
simulate every whisker."""


def land_force_n(whisker: Whisker, *, preload_mm: float, mu: float) -> Vector:
    """Contact force on the tip sliding on the land, (3,) float64, N: eqs. (10) and (11) at h = 0."""
    f_n = enhancement.normal_force_n(whisker.tip_model(), lift_mm=preload_mm, mu=mu)
    return enhancement.contact_force(f_n, alpha_rad=0.0, mu=mu)


def deflection_ratio(whisker: Whisker, *, preload_mm: float, mu: float) -> float:
    """Ratio of the tip deflection |D11 f| on the land to l1 (other whiskers: to their reach), for Assumption 1."""
    force = land_force_n(whisker, preload_mm=preload_mm, mu=mu)
    return float(np.linalg.norm(whisker.tip_model().compliance_mm_per_n @ force)) / whisker.reach_mm


@dataclass(frozen=True, eq=False, repr=False)
class LumpedWhisker(OneLine):
    """A whisker with its mass, t (N s^2 / mm), at (n, 3) joints; `strain` (6 n, 3 n) under unit forces on them."""

    joints_mm: Matrix
    mass_t: Vector
    strain: Matrix


def lumped_whisker(whisker: Whisker, *, parts: int) -> LumpedWhisker:
    """Divide a whisker into pieces, and lump half the mass of each at either end. strain^T strain is the flexibility,
    exact for constant sections: M = r x f is linear along a piece, so two Gauss points suffice."""
    require_range(WhiskerError, Range(1, math.inf, "it must be at least 1"), parts=parts)
    segments = whisker.segments()
    middle = (np.arange(parts) + 0.5) / parts
    gauss = (middle[:, None] + np.array([-1.0, 1.0]) * math.sqrt(1.0 / 12.0) / parts).ravel()
    n = parts * len(segments)
    joints = np.concatenate([segment.points_mm((np.arange(parts) + 1.0) / parts) for segment in segments])
    points = np.concatenate([segment.points_mm(gauss) for segment in segments])
    mass = np.zeros(n + 1)
    roots = []
    for s, segment in enumerate(segments):
        length = segment.length_mm / parts
        areas = np.array([segment.section_at(float(t)).area_mm2 for t in middle])
        share = segment.material.density_t_mm3 * areas * length / 2.0
        mass[s * parts : (s + 1) * parts] += share
        mass[s * parts + 1 : (s + 1) * parts + 1] += share
        roots.append(np.linalg.cholesky(segment.section_compliances(gauss) * (length / 2.0)).swapaxes(1, 2))
    moments = np.concatenate(roots)[:, None] @ cross_matrix(joints - points[:, None])
    # a force bends only the whisker between it and the base
    beyond = np.arange(n) >= np.arange(2 * n)[:, None] // 2
    strain = np.swapaxes(moments * beyond[..., None, None], 1, 2)
    return LumpedWhisker(joints, mass[1:], strain.reshape(6 * n, 3 * n))


def first_bending_frequency_hz(
    whisker: Whisker, *, tip_held: bool = False, in_plane: bool = False, parts: int = 24
) -> float:
    """Lowest natural frequency of the whisker, Hz, for Assumption 5; rotary inertia is left out.

    Mass is lumped at the joints of `parts` pieces per segment: a straight whisker is within 0.2 % of 3.516 / (2 pi l^2)
    sqrt(EI / rho A). `tip_held`: contact keeps the tip at its height, as while tracing (Assumption 3). The up-and-down
    frequency of a straight whisker is then 4.4 times higher; its sideways frequency, the lowest of round wire, does not
    change, and counts unless only the plane of tracing is asked for (`in_plane`).
    """
    lumped = lumped_whisker(whisker, parts=parts)
    weighted = lumped.strain * np.outer(np.sqrt(lumped.mass_t), [1.0, 1.0, not in_plane]).ravel()
    if tip_held:
        reaction = lumped.strain[:, -2]
        weighted -= np.outer(reaction, reaction @ weighted) / (reaction @ reaction)
    slowest = float(np.linalg.norm(weighted, 2)) ** 2
    return 1.0 / (2.0 * math.pi * math.sqrt(slowest))
