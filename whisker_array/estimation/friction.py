"""Friction of the land from the scan itself: by mixed shapes, or by dragging and pushing back.

Both routes use the land only, where the slope is zero and (22) reduces to g(0, mu) = -mu. Each whisker (or pair of
whiskers on one line) gives one mu; the standard error is from their spread, and so includes errors of the gains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MapError
from whisker_array.arrays import Floats
from whisker_array.estimation.edges import usable_moments
from whisker_array.estimation.estimate import friction_from_shapes, friction_from_two_ways, is_profiler
from whisker_array.estimation.land import land_coefficients, land_surface
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep

USABLE_SD = 0.05
"""Largest standard error of a usable friction; the nominal friction is within about 0.15 without a measurement."""


class FrictionRoute(StrEnum):
    """Ways of measuring friction."""

    SHAPES = "shapes"
    TWO_WAYS = "two ways"


@dataclass(frozen=True)
class LandFriction:
    """Friction of the land; `sd` is its standard error, from the spread over whiskers and sweeps."""

    mu: float
    sd: float
    route: FrictionRoute


def land_friction(scan: Scan) -> tuple[LandFriction, ...]:
    """Find the land's friction by every route that a scan allows, the most certain first. SHAPES needs a profiler on
    the lines of a differentiator, and gains from a bench, TWO_WAYS passes that are traced both ways."""
    differ = [i for i, touch in enumerate(scan.touches) if not is_profiler(touch.tip)]
    profile = [i for i, touch in enumerate(scan.touches) if is_profiler(touch.tip)]
    estimates = []
    if differ and profile and not (scan.calibration is not None and scan.calibration.from_land):
        estimates.append(_by_shapes(scan, differ[0], profile[0]))
    if differ and any(s.plan.pushed for s in scan.sweeps):
        estimates.append(_by_two_ways(scan, differ[0]))
    return tuple(sorted((f for f in estimates if f is not None), key=lambda f: f.sd))


@dataclass(frozen=True, eq=False)
class _LandLines:
    moment: Floats
    place_mm: Floats
    whisker: NDArray[np.int64]

    def meets(self, other: _LandLines) -> bool:
        return self.moment.shape == other.moment.shape and np.allclose(self.place_mm, other.place_mm)


def _land_lines(scan: Scan, sweep: Sweep, kind: int, *, band: float = 0.03) -> _LandLines:
    columns = np.flatnonzero(np.asarray(scan.kind) == kind)
    within = slice(sweep.plan.n_lead, sweep.plan.n_samples - sweep.plan.n_lead)
    moment = usable_moments(scan, sweep)[:, columns, within]
    order, whisker, place = sweep.plan.of(columns).lines_in_order()
    lines = moment.reshape(-1, moment.shape[2])[order]
    if sweep.plan.direction.backward:
        lines = lines[:, ::-1]
    # land is estimated per whisker, because gains differ, and from dragged sweeps, because pushed ones may jam
    for w in np.unique(whisker) if not sweep.plan.pushed else ():
        rows = np.flatnonzero((whisker == w) & np.isfinite(lines).any(axis=1))
        if rows.size:
            land = land_surface(land_coefficients(lines[rows]), lines[rows].shape)
            off = np.abs(lines[rows] / land - 1.0) > band
            lines[rows] = np.where(off, np.nan, lines[rows])
    return _LandLines(lines, place, whisker)


def _mean_friction(
    pairs: Iterable[tuple[_LandLines, _LandLines]],
    solve: Callable[[Floats, Floats], Floats],
    route: FrictionRoute,
    *,
    fewest: int = 16,
) -> LandFriction | None:
    estimates: dict[int, list[float]] = {}
    for first, other in pairs:
        both = np.isfinite(first.moment) & np.isfinite(other.moment)
        enough = both.sum(axis=1) >= fewest
        a, b = (np.nanmedian(np.where(both, v.moment, np.nan)[enough], axis=1) for v in (first, other))
        mu, whisker = solve(a, b), first.whisker[enough]
        for w in np.unique(whisker):
            estimates.setdefault(int(w), []).append(float(np.nanmedian(mu[whisker == w])))
    each = [np.mean(estimates[w]) for w in sorted(estimates)]
    values = np.array([v for v in each if np.isfinite(v)])
    if not values.size:
        return None
    sd = float(values.std(ddof=1) / np.sqrt(values.size)) if values.size > 1 else float("inf")
    return LandFriction(mu=max(0.0, float(values.mean())), sd=sd, route=route)


def _by_shapes(scan: Scan, differ: int, profile: int) -> LandFriction | None:
    first, other = scan.touches[differ], scan.touches[profile]
    pairs = [
        (_land_lines(scan, sweep, differ), _land_lines(scan, sweep, profile))
        for sweep in scan.sweeps
        if not sweep.plan.pushed
    ]
    if not all(a.meets(b) for a, b in pairs):
        raise MapError("the rows of the array do not run on the same lines")

    def solve(a: Floats, b: Floats) -> Floats:
        # moments per mm of preload, because both need the same lift
        a, b = a / first.preload_mm, b / other.preload_mm
        return friction_from_shapes(a, b, differentiator=first.tip, profiler=other.tip)

    return _mean_friction(pairs, solve, FrictionRoute.SHAPES)


def _by_two_ways(scan: Scan, kind: int) -> LandFriction | None:
    lines = {(int(s.plan.direction), s.plan.pushed): _land_lines(scan, s, kind) for s in scan.sweeps}
    pairs = [
        (dragged, back)
        for (direction, pushed), dragged in lines.items()
        if not pushed and (back := lines.get(((direction + 180) % 360, True))) and dragged.meets(back)
    ]
    tip = scan.touches[kind].tip
    return _mean_friction(pairs, lambda a, b: friction_from_two_ways(a, b, tip), FrictionRoute.TWO_WAYS)
