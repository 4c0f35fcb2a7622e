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

    (7)          e_y . D11 f = d0 + h: the surface sets the tip's height; D11 is `TipModel.compliance_mm_per_n`
    (8) to (10)  f = f_n R a: `rotation`, `contact_direction`, `contact_force`
    (11)         f_n at a height and a slope: `normal_force_n`
    (13), (14)   m = s3 . T1 f: `moment_n_mm`, `land_moment_n_mm`; s3 . T1 is `TipModel.moment_arm_mm`
    (15), (16)   F, the moment on a slope over that on the land: `enhancement_factor`, `moment_ratio` for arrays
    (17), (18)   straight whisker: D11 = l^3 / (3 E I) n n^T, so F = 1
    (19) to (21) L-shaped whisker: its D11 ((20) is misprinted in two terms) and T1
    (22)         L-shaped whisker, o = (l2 - l3) / l1, c and s of the setting angle:
                 F = [c - (s + o) g(alpha)] / [c - (s + o) g(0)]
                   . [c - (s + 1.5 k) g(0)] / [c - (s + 1.5 k) g(alpha)]
    (23)         g = (tan(alpha) - mu) / (1 + mu tan(alpha)) = tan(alpha - atan(mu)), the lean of the force
    (24)         beta = 0, l3 = l2: F = [1 - 1.5 k g(0)] / [1 - 1.5 k g(alpha)]
    (25), (26)   the same with h = -g, which has the form 0/0 at alpha = 0
    (27)         mu = 0: F = 1 / (1 - 1.5 k tan(alpha)), singular at tan(alpha) = 2 / (3 k)

`beam` integrates any chain of segments, so (17) to (27) are not computed here; the tests compare with them
(`tests/support/paper.py`, which has the corrected (20) in full).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from glyphs.errors import MarksError
from glyphs.ranges import require_not_negative, require_range
from whisker_array.arrays import Floats
from whisker_array.whisker.sections import UPRIGHT, WhiskerError

if TYPE_CHECKING:
    from whisker_array.whisker.shapes import TipModel


def jam_error(error: type[MarksError], alpha_rad: float, mu: float) -> MarksError:
    """Return the error for a whisker whose contact force cannot lift its tip."""
    what = (
        f"the whisker jams at alpha = {alpha_rad:.3f} rad, mu = {mu}: the contact force cannot lift the tip"
    )
    return error(what, hint="take a smaller k, or a surface less steep")


def _divide(numerator: float, denominator: float, what: str) -> float:
    if denominator == 0.0:
        raise WhiskerError(f"F has no value here: {what}")
    return numerator / denominator


def rotation(alpha_rad: float) -> Floats:
    """Eq. (9): R(alpha), from surface axes (t1, n, t2) to the world; (3, 3) float64."""
    require_range(WhiskerError, UPRIGHT, alpha_rad=alpha_rad)
    c, s = math.cos(alpha_rad), math.sin(alpha_rad)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def contact_direction(mu: float) -> Floats:
    """a of eq. (10) = (-mu, 1, 0): contact force per normal force in surface axes; (3,) float64."""
    require_not_negative(WhiskerError, mu=mu)
    return np.array([-mu, 1.0, 0.0])


def contact_force(normal_force_n: float, *, alpha_rad: float, mu: float) -> Floats:
    """Eqs. (8) and (10): f = f_n R a, the force on the sliding tip in world axes; (3,) float64, N."""
    return np.asarray(normal_force_n * (rotation(alpha_rad) @ contact_direction(mu)))


def normal_force_n(tip_model: TipModel, *, lift_mm: float, alpha_rad: float = 0.0, mu: float) -> float:
    """Eqs. (7) and (11): the normal force at which the tip is at the height of the surface, N.

    f_n = (d0 + h) / (e_y . D11 R a), where lift_mm = d0 + h is the height of the tip above its unloaded path.
    Raises WhiskerError where the whisker jams: no force within the friction cone lifts the tip.
    """
    give = float(tip_model.compliance_mm_per_n[1] @ rotation(alpha_rad) @ contact_direction(mu))
    if give <= 0.0:
        raise jam_error(WhiskerError, alpha_rad, mu)
    return lift_mm / give


def moment_n_mm(force_n: ArrayLike, tip_model: TipModel) -> float:
    """Eq. (13), with (10) also (14): m = s3 . T1 f, the moment at the sensor about the lateral axis, N mm.

    The moment on the land is negative, because the tip is behind the base and pushed up.
    """
    return float(tip_model.moment_arm_mm @ np.asarray(force_n, dtype=np.float64))


def land_moment_n_mm(tip_model: TipModel, *, preload_mm: float, mu: float) -> float:
    """Eqs. (11) and (14) at alpha = 0, h = 0: the moment on the undisturbed land, N mm (negative)."""
    f_n = normal_force_n(tip_model, lift_mm=preload_mm, mu=mu)
    return moment_n_mm(contact_force(f_n, alpha_rad=0.0, mu=mu), tip_model)


def enhancement_factor(tip_model: TipModel, *, alpha_rad: float, mu: float) -> float:
    """Eq. (16), any whisker: `F = (e_y.D11 R a / e_y.D11 R'a) (s3.T1 R'a / s3.T1 R a)`.

    R = R(0) is the land, R' = R(alpha) the slope. Raises WhiskerError where one of the two denominators vanishes.
    """
    land = contact_direction(mu)
    slope = rotation(alpha_rad) @ land
    row = tip_model.compliance_mm_per_n[1]
    arm = tip_model.moment_arm_mm
    lift = _divide(float(row @ land), float(row @ slope), "the force on this slope cannot lift the tip")
    turn = _divide(float(arm @ slope), float(arm @ land), "the force on the land makes no moment")
    return lift * turn


def _lift_and_turn(slope: ArrayLike, mu: float, tip_model: TipModel) -> tuple[Floats, Floats]:
    require_not_negative(WhiskerError, mu=mu)
    p = np.asarray(slope, dtype=np.float64)
    along, up = -mu - p, 1.0 - mu * p
    row, arm = tip_model.compliance_mm_per_n[1], tip_model.moment_arm_mm
    return row[0] * along + row[1] * up, arm[0] * along + arm[1] * up


def moment_ratio(slope: ArrayLike, mu: float, tip_model: TipModel) -> Floats:
    """Eq. (16) for arrays: F at the surface slope dh/dx = -tan(alpha) along the trace.

    1 on the land, NaN where the whisker jams or the slope is NaN. Raises WhiskerError if it jams on the land.
    """
    lift, turn = _lift_and_turn(slope, mu, tip_model)
    land_lift, land_turn = (float(v) for v in _lift_and_turn(0.0, mu, tip_model))
    if land_lift <= 0.0 or land_turn == 0.0:
        raise WhiskerError(f"with mu = {mu} the whisker jams, or makes no moment, on the land itself")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (land_lift / land_turn) * turn / lift
    return np.where(lift > 0.0, ratio, np.nan)
