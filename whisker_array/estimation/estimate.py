"""Estimate lift, slope and friction from moments, sample by sample, for any whisker.

With tau the angle at which the surface rises in +x and phi = atan(mu), the contact force leans by an angle theta::

                          f     f_x / f_y = -tan(theta)
        theta = tau + phi  ^
                            \\          dragged, base ahead in +x:      theta =  tau + phi
      ____                   \\   ___    dragged the other way (turned): theta = -tau + phi
          \\___ tau < 0 ___ ___\\_/       pushed back, base still in +x:  theta =  tau - phi   (mu changes sign)

and eqs. (7), (11), (14) give m = lift G(theta), lift = d0 + h, with G a ratio of two linear forms of tan(theta). A
profiler's G is one number (Case study 1), so it gives the lift; the inverse of a differentiator's G gives theta.
The functions here compute one of these quantities from the others. Angles in rad, lengths in mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from whisker_array.arrays import Floats
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel


def moment_per_lift(theta_rad: ArrayLike, tip: TipModel) -> Floats:
    """G of m = lift G(theta), eqs. (11) and (14), N mm per mm; NaN where the force cannot lift the tip."""
    return _per_lift(tip.moment_arm_mm, theta_rad, tip)


def _per_lift(of_force: Floats, theta_rad: ArrayLike, tip: TipModel) -> Floats:
    t, row = np.tan(np.asarray(theta_rad, dtype=np.float64)), tip.compliance_mm_per_n[1]
    give = row[1] - row[0] * t
    return np.where(give > 0.0, (of_force[1] - of_force[0] * t) / np.where(give > 0.0, give, 1.0), np.nan)


def is_profiler(tip: TipModel, *, tolerance: float = 1e-3) -> bool:
    """Whether F = 1 for every slope and friction: G is one number, so the moment is the profile. G then changes by at
    most the share `tolerance` between theta = 0 and 45 degrees, as for straight whiskers, (17), (18), and for an
    L-shaped whisker whose sensor sits l2 / 2 above its clamp, l3 = -l2 / 2: both factors of (22) are equal."""
    level, leaning = moment_per_lift(np.array([0.0, np.pi / 4.0]), tip)
    return bool(np.isfinite(leaning) and abs(leaning - level) <= tolerance * abs(level))


def _require_differentiator(tip: TipModel, why: str) -> None:
    if is_profiler(tip):
        raise WhiskerError(f"a profiler {why}", hint="take an L-shaped whisker with l3 = l2")


def lift_from_profiler(moment_n_mm: ArrayLike, tip: TipModel) -> Floats:
    """Lift d0 + h of the tip, mm, from a profiler's moment. Raises WhiskerError for any other whisker."""
    if not is_profiler(tip):
        raise WhiskerError("the whisker is not a profiler: its moment depends on slope and friction too")
    return np.asarray(moment_n_mm, dtype=np.float64) / float(moment_per_lift(0.0, tip))


def lean_from_moment(moment_n_mm: ArrayLike, lift_mm: ArrayLike, tip: TipModel) -> Floats:
    """theta of the contact force from a differentiator's moment where the lift is known; broadcast shapes.

    m (row_y - row_x t) = lift (arm_y - arm_x t), solved for t = tan(theta); rad, NaN without a solution. Raises
    WhiskerError for a profiler, whose moment does not depend on the lean.
    """
    _require_differentiator(tip, "does not measure the slope")
    m, lift = np.asarray(moment_n_mm, dtype=np.float64), np.asarray(lift_mm, dtype=np.float64)
    row, arm = tip.compliance_mm_per_n[1], tip.moment_arm_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (m * row[1] - lift * arm[1]) / (m * row[0] - lift * arm[0])
        right_side = (row[1] - row[0] * t) > 0.0
    return np.where(np.isfinite(t) & right_side, np.arctan(t), np.nan)


def friction_from_shapes(
    differentiator_n_mm: ArrayLike, profiler_n_mm: ArrayLike, *, differentiator: TipModel, profiler: TipModel
) -> Floats:
    """mu on level land from the moments of both shapes at one place: g(0, mu) = -mu in (22).

    The ratio changes only by 1.5 k per unit of mu (k = 0.117: 1 % of gain is 0.06 of mu), so the gains must be known
    from a bench, not from land.
    """
    lift = lift_from_profiler(profiler_n_mm, profiler)
    return np.tan(lean_from_moment(differentiator_n_mm, lift, differentiator))


def friction_from_two_ways(dragged_n_mm: ArrayLike, pushed_n_mm: ArrayLike, tip: TipModel) -> Floats:
    """mu on level land from one differentiator dragged and pushed back: mu changes sign, the gain cancels.

    q = G(phi) / G(-phi) is a quadratic in mu; with l3 = l2, q = (1 - 1.5 k mu) / (1 + 1.5 k mu). NaN where no friction
    fits. Raises WhiskerError for a profiler, whose moment is the same both ways.
    """
    _require_differentiator(tip, "measures the same both ways")
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.asarray(dragged_n_mm, dtype=np.float64) / np.asarray(pushed_n_mm, dtype=np.float64)
    row, arm = tip.compliance_mm_per_n[1], tip.moment_arm_mm
    # (arm_y - arm_x mu)(row_y + row_x mu) = q (arm_y + arm_x mu)(row_y - row_x mu)
    cross = arm[1] * row[0] - arm[0] * row[1]
    return _small_root(-arm[0] * row[0] * (1.0 - q), cross * (1.0 + q), arm[1] * row[1] * (1.0 - q))


def tip_shift_mm(theta_rad: ArrayLike, lift_mm: ArrayLike, tip: TipModel) -> Floats:
    """Shift of the tip along x from its unloaded position, e_x.D11 f with e_y.D11 f = lift, mm."""
    return _per_lift(tip.compliance_mm_per_n[0], theta_rad, tip) * np.asarray(lift_mm, dtype=np.float64)


def _small_root(a: Floats, b: Floats, c: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        disc = b * b - 4.0 * a * c
        root = -2.0 * c / (b + np.copysign(np.sqrt(disc), b))
    return np.where(disc >= 0.0, root, np.nan)
