"""The exact bent shape of a planar whisker (the elastica), to judge the linear beam of Assumption 1.

An inextensible Kirchhoff rod, geometrically exact in the plane of tracing, clamped at its base, with rigid corners. The
height of the tip and the direction of the contact force are given; the size of the force is unknown. With p(s) the bent
line and psi(s) its rotation from the unbent shape (psi is continuous at a corner)::

    y ^     .--o clamp            EI psi' = (p_tip - p) x f,   f = f_n R(alpha) a        (8)-(10)
      |  ,-'                      p' = (cos, sin)(theta_rest + psi)
      | o    s: clamp to tip      psi = 0 at the clamp,  e_y.(p_tip - p_tip at rest) = lift
      |  \\
      |   o  ^ f                  linear beam: the arm (p_tip - p) and p' at rest, to first order in psi
      +---------------------> x

The equations are made dimensionless by the whole length L, the lift and the linear normal force, so that the unknowns
stay near one at any lift, and for lift / L -> 0 the system *is* the linear one. Ball radius and stretching are left out
here and in the linear beam for comparison (axial=False; the axial term would change its force by 2e-6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from glyphs.ranges import Finite, Validated, freeze_arrays, require_positive
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.whisker import enhancement
from whisker_array.whisker.beam import (
    Matrix,
    Segment,
    Vector,
    chain_compliance,
    cross_matrix,
)
from whisker_array.whisker.sections import Taper
from whisker_array.whisker.shapes import Whisker

LOAD_STEP, _TURN_STEP_RAD, _SMALLEST_STEP = 0.1, 0.5, 1e-3
"""Limits of a load step: greatest lift in whole lengths, greatest rotation, smallest share of the first step."""
_TOLERANCE = 1e-7
"""Relative residual of the equations for solve_bvp; force and tip are then exact to 2e-8."""
_FIRST_NODES, _MAX_NODES, _SHAPE_POINTS = 13, 4000, 128
"""Initial nodes per segment; most nodes in all segments (at least 100 in each); points of the bent line."""


class ElasticaError(MarksError):
    """A load or whisker without an exact solution."""


@dataclass(frozen=True, eq=False, repr=False)
class LargeDeflection(OneLine, Validated, error=ElasticaError):
    """Exact solution for a whisker whose tip is held at a height. Raises ElasticaError.

    Force (3,) on the tip, N, and shift (3,) of the tip from its unloaded position, mm, are in world axes: away from the
    base is negative x. The moment, N mm, about the lateral axis at the sensor has the arm to the *deformed* tip, and
    signs as `enhancement.moment_n_mm` (negative on the land). The shape (n, 2) is (x, y) from the clamp to the tip, mm.
    Arrays are read-only.
    """

    force_n: Vector
    moment_n_mm: Finite
    tip_shift_mm: Vector
    shape_mm: Matrix

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_arrays(ElasticaError, self, {"force_n": (3,), "tip_shift_mm": (3,), "shape_mm": ("n", 2)})


@dataclass(frozen=True)
class LinearError:
    """Errors of the linear beam at one lift, (linear - exact) / exact: positive where it overestimates. Those of force
    and arm, in (13) that to the unloaded tip, partly cancel."""

    lift_mm: float
    force: float
    moment: float
    shift_mm: float

    @property
    def worst(self) -> float:
        return max(abs(self.force), abs(self.moment))


@dataclass(frozen=True)
class _Rod:
    segments: tuple[Segment, ...]
    length_mm: float
    start: Floats  # (2, n, 1) where each segment begins
    along: Floats  # (2, n, 1) from its beginning to its end
    push: Vector  # (3,) R a, force per normal force
    arm_mm: Vector  # (3,) third row of T1
    yields_mm_per_n: Vector  # (3,) D11 R a, shift of the tip per normal force by the linear inextensible beam

    @property
    def angle(self) -> Matrix:
        return np.asarray(np.arctan2(self.along[1], self.along[0]))

    @property
    def share(self) -> Matrix:
        return np.asarray(np.hypot(self.along[0], self.along[1]))

    def softness(self, t: Vector) -> Matrix:
        ei = np.empty((len(self.segments), t.size))
        for row, s in zip(ei, self.segments, strict=True):
            places = t if isinstance(s.section, Taper) else t[:1]
            row[:] = [s.material.e_mpa * s.section_at(float(u)).i_vertical_mm4 for u in places]
        return np.asarray(self.share * self.length_mm**3 / (self.yields_mm_per_n[1] * ei))


def _rod(whisker: Whisker, *, mu: float, alpha_rad: float) -> _Rod:
    push = enhancement.contact_force(1.0, alpha_rad=alpha_rad, mu=mu)
    segments = whisker.segments()
    points = np.array([segments[0].start_mm] + [s.end_mm for s in segments])
    if np.ptp(points[:, 2]) > 1e-9 * np.abs(points - points[0]).max():
        raise ElasticaError(
            "the whisker leaves the plane of tracing", hint="give a chain with one z for all points"
        )
    d11 = chain_compliance(segments, axial=False)[:3, :3]
    if not (d11 @ push)[1] > 0.0:
        raise enhancement.jam_error(ElasticaError, alpha_rad, mu)
    length = sum(s.length_mm for s in segments)
    line = (points[:, :2] - points[-1, :2]).T[:, :, None] / length
    arm = whisker.tip_model().moment_arm_mm
    return _Rod(segments, length, line[:, :-1], np.diff(line, axis=1), push, arm, np.asarray(d11 @ push))


def _solve(rod: _Rod, bend: float, mesh: Vector, guess: Matrix, force: float) -> Any:
    """solve_bvp at one lift; bend = lift / L.

    The state (3 n, nodes) is rotations psi / bend, then shifts in x and in y *relative to the shifted tip*, over the
    lift. The only parameter is the force over the linear force. The 3 n + 1 conditions are: no rotation at the clamp,
    the clamp shifted one lift down relative to the tip, no shift at the tip, continuity at every corner.
    """
    from scipy.integrate import solve_bvp

    n = len(rod.segments)
    fx, fy = (float(v) for v in rod.push[:2])

    def curvature(t: Vector, u: Matrix, v: Matrix) -> Matrix:  # under the linear force
        x0, y0 = rod.start + t * rod.along
        return np.asarray(rod.softness(t) * (-(x0 + bend * u) * fy + (y0 + bend * v) * fx))

    def slope(t: Vector, y: Matrix, p: Vector) -> Matrix:
        turn, u, v = y.reshape(3, n, -1)
        half = bend * turn / 2.0
        chord = rod.share * turn * np.sinc(half / np.pi)  # (cos(a + 2h) - cos a) / bend without cancellation
        shifts = (-chord * np.sin(rod.angle + half), chord * np.cos(rod.angle + half))
        return np.concatenate([p[0] * curvature(t, u, v), *shifts])

    def slope_derivatives(t: Vector, y: Matrix, p: Vector) -> tuple[Floats, Floats]:
        turn, u, v = y.reshape(3, n, -1)
        by_state, by_force = np.zeros((3, n, 3, n, t.size)), np.zeros((3, n, t.size))
        each, soft = np.arange(n), p[0] * bend * rod.softness(t)
        by_state[0, each, 1, each] = -soft * fy
        by_state[0, each, 2, each] = soft * fx
        by_state[1, each, 0, each] = -rod.share * np.sin(rod.angle + bend * turn)
        by_state[2, each, 0, each] = rod.share * np.cos(rod.angle + bend * turn)
        by_force[0] = curvature(t, u, v)
        return by_state.reshape(3 * n, 3 * n, -1), by_force.reshape(3 * n, 1, -1)

    def ends(first: Vector, last: Vector, p: Vector) -> Vector:
        a, b = first.reshape(3, n), last.reshape(3, n)
        return np.concatenate([[a[0, 0], a[2, 0] + 1.0, b[1, -1], b[2, -1]], (a[:, 1:] - b[:, :-1]).ravel()])

    with np.errstate(all="ignore"):  # a failed Newton step overflows; `success` shows it
        return solve_bvp(
            slope, ends, mesh, guess, [force], fun_jac=slope_derivatives, tol=_TOLERANCE,
            max_nodes=max(100, _MAX_NODES // n),
        )  # fmt: skip


def _follow(rod: _Rod, target: float) -> Any:
    """Solve from the linear beam up to lift / L = target, in load steps, by Newton from the unloaded rod. A step is
    accepted near the last one in force and shape, so that it does not jump to another branch."""
    n = len(rod.segments)
    mesh, guess, force = np.linspace(0.0, 1.0, _FIRST_NODES), np.zeros((3 * n, _FIRST_NODES)), 0.0
    reached, step = 0.0, min(LOAD_STEP, target)
    while True:
        bend = min(reached + step, target)
        solved = _solve(rod, bend, mesh, guess, force)
        turned_rad = np.abs(bend * solved.sol(mesh)[:n] - reached * guess[:n]).max()
        if solved.success and 0.5 < solved.p[0] / (force or 1.0) < 2.0 and turned_rad < _TURN_STEP_RAD:
            if bend >= target:
                return solved
            guess, force, reached = solved.sol(mesh), float(solved.p[0]), bend
            step = min(2.0 * step, LOAD_STEP)
            continue
        step /= 4.0
        if step < _SMALLEST_STEP * min(LOAD_STEP, target):
            raise ElasticaError(
                f"no bent shape found beyond a lift of {reached * rod.length_mm:.3g} mm: there the "
                "tip slips through, jams or folds",
                hint="lower the lift, the friction or the slope, or thicken a taper's end",
            )


def _shape(rod: _Rod, solution: Any, lift_mm: float) -> Matrix:
    n = len(rod.segments)
    t = np.linspace(0.0, 1.0, max(2, math.ceil(_SHAPE_POINTS / n)) + 1)
    shift = solution.sol(t).reshape(3, n, -1)[1:]
    line = rod.length_mm * (rod.start + t * rod.along) + lift_mm * shift
    line = np.concatenate([line[:, 0, :1], line[:, :, 1:].reshape(2, -1)], axis=1)
    return np.asarray((line - line[:, :1]).T)


def large_deflection(
    whisker: Whisker, *, lift_mm: float, mu: float = 0.0, alpha_rad: float = 0.0
) -> LargeDeflection:
    """Compute the exact force, moment and shape of a whisker on a surface: (11) and (13) without linearisation.

    Raises ElasticaError if the lift is out of reach or without a solution, or the whisker jams or leaves the plane.
    """
    return _bend(_rod(whisker, mu=mu, alpha_rad=alpha_rad), lift_mm)


def _bend(rod: _Rod, lift_mm: float) -> LargeDeflection:
    require_positive(ElasticaError, lift_mm=lift_mm)
    if not abs(height := lift_mm - float(rod.start[1, 0, 0]) * rod.length_mm) < rod.length_mm:
        raise ElasticaError(
            f"the tip cannot be {height:g} mm above the clamp of a whisker {rod.length_mm:g} mm long",
            hint="lower the lift",
        )
    solution = _follow(rod, lift_mm / rod.length_mm)
    force = float(solution.p[0]) * lift_mm / rod.yields_mm_per_n[1] * rod.push
    shift = np.array([-lift_mm * float(solution.y[len(rod.segments), 0]), lift_mm, 0.0])
    arm = rod.arm_mm + cross_matrix(shift)[2]
    return LargeDeflection(force, float(arm @ force), shift, _shape(rod, solution, lift_mm))


def linear_error(whisker: Whisker, *, lift_mm: float, mu: float = 0.0, alpha_rad: float = 0.0) -> LinearError:
    """Compute the errors of the linear beam of (7), (11), (13) at a lift, relative to `large_deflection`.

    To first order, without friction on the land, the error of an L-shaped whisker with beta = 0 is 3.375 k lift / l1 in
    force and 1.875 k lift / l1 in moment (its tip arm swings out); that of a straight whisker is only of order
    (lift / l)^2.
    """
    rod = _rod(whisker, mu=mu, alpha_rad=alpha_rad)
    exact = _bend(rod, lift_mm)
    normal_n = lift_mm / rod.yields_mm_per_n[1]
    force = normal_n * rod.push
    share = float(np.linalg.norm(force) / np.linalg.norm(exact.force_n)) - 1.0
    moment = _relative_moment(float(rod.arm_mm @ force), exact) - 1.0
    shift = float(normal_n * rod.yields_mm_per_n[0] - exact.tip_shift_mm[0])
    return LinearError(lift_mm, force=share, moment=moment, shift_mm=shift)


def _relative_moment(moment_n_mm: float, exact: LargeDeflection) -> float:
    if exact.moment_n_mm == 0.0:
        raise ElasticaError("the force makes no moment at the sensor to compare with", hint="change l3")
    return moment_n_mm / exact.moment_n_mm


def enhancement_exact(whisker: Whisker, *, preload_mm: float, alpha_rad: float, mu: float) -> float:
    """F of (15) and (16) with both states exact, at one tip height; it tends to (16) as the preload vanishes."""
    slope = large_deflection(whisker, lift_mm=preload_mm, mu=mu, alpha_rad=alpha_rad)
    return _relative_moment(slope.moment_n_mm, large_deflection(whisker, lift_mm=preload_mm, mu=mu))
