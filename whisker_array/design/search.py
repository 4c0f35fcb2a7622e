"""The search behind a design: SLSQP from many starts over the shape of the whisker and its preload.

Variables: ln l1, ln k, beta, height of the sensor's axis over the free tip in l1, ln thickness, ln aspect, ln d0
and the contrast tau. tau is maximised under step >= tau for every lip, wall and friction, so that the worst
case is smooth, and under every constraint of `checks.check`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.design.checks import FINEST_WAVELENGTH_LINES, Checked, check, first_frequency_hz
from whisker_array.design.limits import Bound, Limits, Request
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.validity import QUASI_STATIC_SHARE

SectionKind = Literal["ribbon", "round"]

LIMIT_MARGIN = 1e-3
"""Logarithmic distance that the search keeps from every limit, so that a rounded design keeps it, too."""
_LEAST_RESERVE = 5e-4
_STEP = 1e-5
_MAX_ITERATIONS = 50
_POLISHES = 4
_GAIN = 2e-5
_WAIT = 6

Objective = Callable[[LShaped, float], Floats]
"""Function of whisker and preload whose smallest entry is maximised."""


@dataclass(frozen=True, repr=False)
class Candidate(OneLine):
    """A whisker in use, as evaluated by the search; it is worth -1 where it jams."""

    whisker: LShaped
    preload_mm: float
    worth: float
    reserve: float


@dataclass(frozen=True, repr=False)
class Problem(OneLine):
    """A search: use, limits, kind of section and objective (default: the worst-case contrast)."""

    request: Request
    limits: Limits
    section: SectionKind = "ribbon"
    error_scale: float = 1.0
    objective: Objective | None = None
    axis_lean_rad: float | None = None

    def box(self) -> Floats:
        """(7, 2) bounds of the variables."""
        lim = self.limits
        aspect = lim.aspect if self.section == "ribbon" else (1.0, 1.0)
        depth = self.request.depth_mm
        top = math.sin(lim.beta_rad[1]) + lim.k[1] + lim.axis_raise
        logs = [lim.l1_mm, lim.k, lim.thickness_mm, aspect, (depth, max(lim.l1_mm[1], 2.0 * depth))]
        l1, k, t, a, d0 = ([math.log(v) for v in pair] for pair in logs)
        return np.asarray([l1, k, list(lim.beta_rad), [0.0, top], t, a, d0], dtype=np.float64)

    def decode(self, x: Floats) -> tuple[LShaped, float]:
        l1, k, t, aspect, d0 = (math.exp(x[i]) for i in (0, 1, 4, 5, 6))
        beta = float(x[2])
        axis = float(x[3]) * l1
        if self.axis_lean_rad is not None:
            axis = l1 * math.cos(beta) / math.tan(self.axis_lean_rad)
        l3 = l1 * (math.sin(beta) + k) - axis
        section = Rectangle(t, t * aspect) if self.section == "ribbon" else Round(t)
        return LShaped(l1, l1 * k, l3, beta, section, self.request.material), d0

    def encode(self, candidate: Candidate) -> Floats:
        w = candidate.whisker
        t, width = sides_mm(w)
        axis = (w.l1_mm * math.sin(w.beta_rad) + w.l2_mm - w.lowered_mm) / w.l1_mm
        logs = [math.log(v) for v in (w.l1_mm, w.k, t, width / t, candidate.preload_mm)]
        x = np.array([logs[0], logs[1], w.beta_rad, axis, *logs[2:]])
        box = self.box()
        return np.asarray(np.clip(x, box[:, 0], box[:, 1]))

    def evaluate(self, whisker: LShaped, preload_mm: float) -> tuple[Floats, Checked]:
        checked = check(
            whisker, self.request, self.limits, preload_mm=preload_mm, error_scale=self.error_scale
        )
        worth = checked.contrast if self.objective is None else self.objective(whisker, preload_mm)
        return np.nan_to_num(np.ravel(worth), nan=-1.0), checked

    def rate(self, whisker: LShaped, preload_mm: float) -> Candidate:
        worth, checked = self.evaluate(whisker, preload_mm)
        least = min(float(r.min()) for r in checked.reserve().values())
        return Candidate(whisker, preload_mm, float(worth.min()), least)


def sides_mm(whisker: LShaped) -> tuple[float, float]:
    """Thickness and width of a whisker, mm; both are the diameter of a wire."""
    section = whisker.segments()[0].section_at(0.0)
    return 2.0 * section.c_vertical_mm, 2.0 * section.c_lateral_mm


def round_candidate(candidate: Candidate, problem: Problem) -> Candidate:
    """Round a candidate to five digits and check it again."""

    def five(value: float) -> float:
        return float(f"{value:.5g}")

    w = candidate.whisker
    t, width = (five(v) for v in sides_mm(w))
    section = Rectangle(t, width) if isinstance(w.section, Rectangle) else Round(t)
    whisker = LShaped(five(w.l1_mm), five(w.l2_mm), five(w.lowered_mm), five(w.beta_rad), section, w.material)
    return problem.rate(whisker, five(candidate.preload_mm))


class _Patience:
    def __init__(self, slack: Callable[[Floats], Floats]) -> None:
        self.slack, self.top, self.waited = slack, -math.inf, 0
        self.best: Floats | None = None

    def __call__(self, y: Floats) -> None:
        if float(self.slack(y).min()) < _LEAST_RESERVE - LIMIT_MARGIN:
            return
        self.waited += 1
        if y[-1] > self.top + _GAIN * abs(y[-1]):
            self.top, self.waited, self.best = float(y[-1]), 0, y.copy()
        if self.waited > _WAIT:
            raise StopIteration


def climb(problem: Problem, start: Floats, *, only_reserve: bool = False) -> Candidate:
    """Run SLSQP from one start; `only_reserve`: maximise the distance from the limits instead of the objective."""
    from scipy.optimize import minimize

    box = problem.box()

    @cache
    def values_at(x: bytes) -> tuple[Floats, int]:
        worth, checked = problem.evaluate(*problem.decode(np.frombuffer(x)))
        reserve = np.concatenate(list(checked.reserve().values())) - LIMIT_MARGIN
        return (reserve, reserve.size) if only_reserve else (np.concatenate([worth, reserve]), worth.size)

    @cache
    def slopes(key: bytes) -> Floats:
        (base, _), x = values_at(key), np.frombuffer(key)
        out = np.zeros((base.size, x.size))
        for i in np.flatnonzero(box[:, 1] > box[:, 0]):
            moved = x.copy()
            moved[i] += _STEP if x[i] + _STEP <= box[i, 1] else -_STEP
            out[:, i] = (values_at(moved.tobytes())[0] - base) / (moved[i] - x[i])
        return out

    start = np.clip(start, box[:, 0], box[:, 1])
    first, n_worth = values_at(start.tobytes())
    share = np.where(np.arange(first.size) < n_worth, 1.0, 0.0)

    def inside(y: Floats) -> Floats:
        return np.clip(y[:-1], box[:, 0], box[:, 1])

    def slack(y: Floats) -> Floats:
        return np.asarray(values_at(inside(y).tobytes())[0] - share * y[-1])

    patience = _Patience(slack)
    optimum = minimize(
        lambda y: -y[-1],
        np.append(start, float(first[:n_worth].min())),
        jac=lambda y: np.append(np.zeros(y.size - 1), -1.0),
        bounds=[*map(tuple, box), (None, None)],
        constraints={
            "type": "ineq",
            "fun": slack,
            "jac": lambda y: np.column_stack([slopes(inside(y).tobytes()), -share]),
        },
        method="SLSQP",
        callback=patience,
        options={"maxiter": _MAX_ITERATIONS, "ftol": 1e-6},
    )  # fmt: skip
    last = problem.rate(*problem.decode(inside(optimum.x)))
    if _is_feasible(last) or patience.best is None:
        return last
    return problem.rate(*problem.decode(inside(patience.best)))


def starts(problem: Problem, *, n: int, rng: np.random.Generator) -> Iterable[Floats]:
    """Starting points: random shape and preload, and a size that is about fast and stiff enough."""
    box, request, limits = problem.box(), problem.request, problem.limits
    ribbon = problem.section == "ribbon"
    for i in range(n):
        depths, reach, spare = np.exp(rng.uniform(np.log([1.3, 15.0, 1.0]), np.log([10.0, 60.0, 2.0])))
        x = box.mean(axis=1)
        x[1] = rng.uniform(math.log(0.02), math.log(0.2))
        x[2] = rng.uniform(box[2, 0], 0.5 * (box[2, 0] + box[2, 1]))
        preload = depths * request.depth_mm
        x[6] = math.log(preload)
        x[0] = np.clip(math.log(reach * preload), *box[0])
        l1 = math.exp(x[0])
        x[3] = (preload + limits.axis_clearance_mm) / l1
        if limits.axis_raise > 0.0 and i % 2:
            # an axis above the line of A has a separate optimum, where the moment falls instead of rising
            x[3] = rng.uniform(*box[3])
        allowed = limits.slide_lines * request.line_pitch_mm
        aspect = max(5.0, math.sqrt(preload * math.tan(request.alpha_rad[1]) / allowed)) if ribbon else 1.0
        x[5] = math.log(aspect)
        whisker, _ = problem.decode(np.where(np.arange(7) == 4, 0.0, x))
        detail_hz = request.least_speed_mm_s / (FINEST_WAVELENGTH_LINES * request.line_pitch_mm)
        x[4] = math.log(spare * detail_hz / QUASI_STATIC_SHARE / first_frequency_hz(whisker))
        yield np.clip(x, box[:, 0], box[:, 1])


def polish(problem: Problem, candidate: Candidate, *, rounds: int = _POLISHES) -> Candidate | None:
    """Climb repeatedly from a candidate, along what is often a flat ridge; None if a constraint is violated."""
    candidate = problem.rate(candidate.whisker, candidate.preload_mm)
    for _ in range(rounds):
        again = climb(problem, problem.encode(candidate))
        done = _is_feasible(candidate) and again.worth < candidate.worth * (1.0 + _GAIN)
        if not _is_feasible(candidate) or (_is_feasible(again) and again.worth > candidate.worth):
            candidate = again
        if done:
            break
    return candidate if _is_feasible(candidate) else None


def _is_feasible(candidate: Candidate) -> bool:
    return candidate.reserve >= _LEAST_RESERVE and math.isfinite(candidate.worth)


def best(problem: Problem, beginnings: Iterable[Floats]) -> Candidate | None:
    """Find the best candidate that meets all constraints, from several starts; None if no candidate does."""
    first = list(beginnings)
    feasible = [c for start in first if _is_feasible(c := climb(problem, start))]
    if not feasible:
        # a distant start can end outside the limits: move inside first
        inside = max(
            (climb(problem, start, only_reserve=True) for start in first[:2]), key=lambda c: c.reserve
        )
        feasible = [inside] if _is_feasible(inside) else []
    top = max(feasible, key=lambda c: c.worth, default=None)
    return None if top is None else polish(problem, top)


def conflict(problem: Problem, beginnings: Sequence[Floats]) -> tuple[Candidate, tuple[Bound, ...]]:
    """Find the point that violates the constraints least, and the constraints that cannot be met together there."""
    nearest = max((climb(problem, x, only_reserve=True) for x in beginnings), key=lambda c: c.reserve)
    _, checked = problem.evaluate(nearest.whisker, nearest.preload_mm)
    reserve = {bound: float(r.min()) for bound, r in checked.reserve().items()}
    worst = min(reserve.values())
    return nearest, tuple(bound for bound, r in reserve.items() if r < worst + 0.02 * max(1.0, abs(worst)))
