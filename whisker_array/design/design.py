"""Design the L-shaped whisker with the largest worst-case edge contrast that can be made and used.

    m / m_land  F  ___                    contrast: the step of the signal at an edge, in land moments,
                  |   \\                   top lip     |F - 1|
    1 ________top |    \\ _____            bottom lip  |F - 1| (1 - depth/d0)
              lip      | bottom lip       the design maximises the least step over both lips,
                       |__________        falling (+alpha) and rising (-alpha) walls and all frictions

By (22) F depends only on A = tan(beta) + 1.5 k / c and the height of the sensor's axis: setting angle and tip arm have
the same effect on F, but with a tip arm l1 twists, so that the tip slides sideways into grooves. F - 1 grows with A
until a steep wall jams; a larger d0 increases the step at the bottom lip until force, linear beam or slide limits it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.design.checks import (
    FINEST_WAVELENGTH_LINES,
    check,
    edge_steps,
    factors,
    first_frequency_hz,
    normal_forces_n,
)
from whisker_array.design.limits import Bound, Constraint, DesignError, Limits, Request
from whisker_array.design.search import (
    LIMIT_MARGIN,
    Candidate,
    Problem,
    SectionKind,
    best,
    conflict,
    polish,
    round_candidate,
    starts,
)
from whisker_array.whisker.elastica import ElasticaError, enhancement_exact, linear_error
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.validity import PRELOAD_MARGIN, QUASI_STATIC_SHARE, first_bending_frequency_hz

SEED = 20
_STARTS = 5
_ELASTICA_ROUNDS = 4
_ELASTICA_NEAR = 0.02
_FINE = 33


class NoWhiskerError(DesignError):
    """No whisker meets all limits together."""

    def __init__(self, problem: Problem, nearest: Candidate, bounds: tuple[Bound, ...]) -> None:
        self.problem, self.nearest, self.bounds = problem, nearest, bounds
        names = ", ".join(bound.value for bound in bounds)
        super().__init__(f"no whisker meets all limits together: {names}")


class Lip(Enum):
    """Edges of a wall."""

    TOP = "top lip"
    BOTTOM = "bottom lip"


@dataclass(frozen=True)
class Worst:
    """The edge with the least step."""

    contrast: float
    alpha_rad: float
    mu: float
    lip: Lip


@dataclass(frozen=True, repr=False)
class Design(OneLine):
    """A whisker, its use, and its distance from every limit.

    `contrast_exact` is that of the worst edge by (16) with F by the elastica, NaN where it has no solution;
    `factor_range` is over all walls and frictions of the request; `linear_error` is the largest error of the linear
    beam's force or moment on the land, as a share of the elastica's.
    """

    request: Request
    limits: Limits
    whisker: LShaped
    preload_mm: float
    speed_mm_s: float
    worst: Worst
    contrast_exact: float
    factor_range: tuple[float, float]
    constraints: tuple[Constraint, ...]
    linear_error: float
    frequency_hz: float
    land_force_n: float

    @property
    def contrast(self) -> float:
        return self.worst.contrast

    @property
    def axis_over_land_mm(self) -> float:
        w = self.whisker
        return w.l1_mm * math.sin(w.beta_rad) + w.l2_mm - w.lowered_mm - self.preload_mm


def worst_edge(whisker: LShaped, request: Request, *, preload_mm: float) -> tuple[Worst, tuple[float, float]]:
    """Find the edge with the least contrast on a fine grid, and the range of F. Raises DesignError."""
    slopes = np.linspace(*request.alpha_rad, _FINE)
    alpha, mu = np.concatenate([slopes, -slopes]), np.linspace(*request.mu, _FINE)
    factor = factors(whisker, alpha_rad=alpha, mu=mu)
    steps = edge_steps(factor, preload_mm=preload_mm, depth_mm=request.depth_mm)
    if not np.isfinite(factor).all():
        raise DesignError("the whisker jams on a wall of the range", hint="take a smaller k or setting angle")
    lip, i, j = np.unravel_index(int(np.argmin(steps)), steps.shape)
    worst = Worst(float(steps.min()), float(alpha[i]), float(mu[j]), (Lip.TOP, Lip.BOTTOM)[int(lip)])
    return worst, (float(factor.min()), float(factor.max()))


def land_linear_error(whisker: LShaped, request: Request, *, preload_mm: float) -> float:
    """Largest error of the linear beam's force or moment on the land, as a share of the elastica's."""
    try:
        return max(linear_error(whisker, lift_mm=preload_mm, mu=mu).worst for mu in request.mu)
    except ElasticaError:
        return math.inf


def design_whisker(
    request: Request,
    *,
    limits: Limits | None = None,
    section: Literal["auto", "ribbon", "round"] = "auto",
    seed: int = SEED,
) -> Design:
    """Design the whisker with the largest worst-case edge contrast (see the module). Raises NoWhiskerError."""
    limits = limits or Limits()
    kinds: tuple[SectionKind, ...] = ("ribbon", "round") if section == "auto" else (section,)
    least = PRELOAD_MARGIN * request.depth_mm * math.tan(request.alpha_rad[1])
    allowed = limits.slide_lines * request.line_pitch_mm
    if least > allowed and section == "round":
        raise DesignError(
            "round wire bends sideways as easily as up and down: even at the least preload for this depth "
            f"its tip slides {least:.2g} mm into grooves along the trace (at most {allowed:.2g} mm is allowed)",
            hint="take a ribbon, larger characters or shallower marks",
        )
    if least > allowed:
        kinds = ("ribbon",)
    problems = (Problem(request, limits, kind) for kind in kinds)
    candidates = [c for each in problems if (c := search(each, n_starts=_STARTS, seed=seed)) is not None]
    if not candidates:
        failed = Problem(request, limits, kinds[0])
        nearest, bounds = conflict(failed, list(starts(failed, n=3, rng=np.random.default_rng(seed))))
        raise NoWhiskerError(failed, nearest, bounds)
    return describe_design(*max(candidates, key=lambda pair: pair[1].worth))


def search(problem: Problem, *, n_starts: int, seed: int) -> tuple[Problem, Candidate] | None:
    """Find the best whisker whose linear beam agrees with the elastica within the limit; None if there is none."""
    candidate = best(problem, starts(problem, n=n_starts, rng=np.random.default_rng(seed)))
    return None if candidate is None else fit_to_elastica(problem, candidate)


def fit_to_elastica(problem: Problem, candidate: Candidate) -> tuple[Problem, Candidate] | None:
    """Repeat the search with the linear beam's error scaled to the exact one, until the limit is just kept."""
    limit, kept = problem.limits.linear_error, []
    for _ in range(_ELASTICA_ROUNDS):
        trial = round_candidate(candidate, problem)
        exact = land_linear_error(trial.whisker, problem.request, preload_mm=trial.preload_mm)
        checked = check(trial.whisker, problem.request, problem.limits, preload_mm=trial.preload_mm)
        first_order = float(checked.table[Bound.LINEAR_BEAM][0].max())
        if exact <= limit and trial.reserve > 0.0:
            kept.append((problem, trial))
        scale = min(2.0 * problem.error_scale, exact / first_order)
        bound_by_it = first_order * problem.error_scale > (1.0 - _ELASTICA_NEAR) * limit
        overdone = bound_by_it and exact < (1.0 - _ELASTICA_NEAR) * limit
        if exact <= limit and not overdone:
            break
        problem = replace(problem, error_scale=scale * (1.0 + LIMIT_MARGIN))
        again = polish(problem, candidate)
        if again is None:
            break
        candidate = again
    return max(kept, key=lambda pair: pair[1].worth, default=None)


def describe_design(problem: Problem, candidate: Candidate) -> Design:
    """Describe a whisker in one use, even if it violates limits. Raises DesignError if it jams."""
    request, limits = problem.request, problem.limits
    whisker, preload_mm = candidate.whisker, candidate.preload_mm
    worst, factor_range = worst_edge(whisker, request, preload_mm=preload_mm)
    error = land_linear_error(whisker, request, preload_mm=preload_mm)
    checked = check(whisker, request, limits, preload_mm=preload_mm, linear_error=error)
    frequency = first_bending_frequency_hz(whisker, tip_held=True)
    wavelength = FINEST_WAVELENGTH_LINES * request.line_pitch_mm
    # take the lower frequency, which is that of the search
    speed = QUASI_STATIC_SHARE * min(frequency, first_frequency_hz(whisker)) * wavelength
    land_n, _ = normal_forces_n(
        whisker, preload_mm=preload_mm, alpha_rad=np.zeros(1), mu=np.array(request.mu)
    )
    try:
        f = enhancement_exact(whisker, preload_mm=preload_mm, alpha_rad=worst.alpha_rad, mu=worst.mu)
        lip = 1.0 if worst.lip is Lip.TOP else 1.0 - request.depth_mm / preload_mm
        exact = abs(f - 1.0) * lip
    except ElasticaError:
        exact = math.nan
    return Design(
        request=request,
        limits=limits,
        whisker=whisker,
        preload_mm=preload_mm,
        speed_mm_s=speed,
        worst=worst,
        contrast_exact=exact,
        factor_range=factor_range,
        constraints=(*checked.rows(), *_sizes(whisker, limits)),
        linear_error=error,
        frequency_hz=frequency,
        land_force_n=float(land_n.max()),
    )


def _sizes(whisker: LShaped, limits: Limits) -> tuple[Constraint, ...]:
    section = whisker.segments()[0].section_at(0.0)
    low, high = limits.beta_rad
    ranges = [
        (Bound.LENGTH, whisker.l1_mm, limits.l1_mm),
        (Bound.K, whisker.k, limits.k),
        (Bound.BETA, math.degrees(whisker.beta_rad), (math.degrees(low), math.degrees(high))),
        (Bound.THICKNESS, 2.0 * section.c_vertical_mm, limits.thickness_mm),
    ]
    if isinstance(section, Rectangle):
        ranges.append((Bound.ASPECT, section.width_mm / section.thickness_mm, limits.aspect))
    return tuple(
        min(Constraint(bound, value, low, False), Constraint(bound, value, high, True), key=lambda c: c.slack)
        for bound, value, (low, high) in ranges
    )
