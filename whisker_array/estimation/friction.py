"""Friction of the land, from what the scan itself shows: by mixed shapes, or by dragging and pushing back.

Both routes look at land only, where the slope is nothing and what is left of (22) is g(0, mu) = -mu. Each whisker (or
pair of them on one line) gives one mu; their spread is the standard error, and so contains the gains' errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MapError
from whisker_array.estimation.edges import UNUSABLE, calibrated_moments
from whisker_array.estimation.estimate import friction_from_shapes, friction_from_two_ways, is_profiler
from whisker_array.estimation.land import plate_land
from whisker_array.estimation.steadied import steadied
from whisker_array.scan.felt_sweep import Sweep
from whisker_array.scan.scan import Scan

LAND_BAND = 0.03
"""Samples within this share of the land's moment are land: marks are 10 % and more."""
USABLE_SD = 0.05
"""A friction known no better is not used: the nominal one is within 0.15 or so without measuring."""
FEWEST_SAMPLES = 16


class FrictionRoute(StrEnum):
    """How a friction was found."""

    SHAPES = "shapes"
    TWO_WAYS = "two ways"


@dataclass(frozen=True)
class LandFriction:
    """Friction of the land.

    Attributes:
        mu: Coulomb coefficient.
        sd: standard error, from the spread over whiskers and sweeps.
        route: how it was found.
    """

    mu: float
    sd: float
    route: FrictionRoute


def land_friction(scan: Scan) -> tuple[LandFriction, ...]:
    """What a scan tells of the land's friction, the surest first; empty where it tells nothing.

    SHAPES needs a profiler on the lines of a differentiator and gains that are known from a bench (not from
    land); TWO_WAYS needs passes felt again on their return, and no gains at all.
    """
    scan = steadied(scan)
    differ = [i for i, touch in enumerate(scan.touches) if not is_profiler(touch.tip)]
    profile = [i for i, touch in enumerate(scan.touches) if is_profiler(touch.tip)]
    found = []
    if differ and profile and not (scan.calibration is not None and scan.calibration.from_land):
        found.append(_by_shapes(scan, differ[0], profile[0]))
    if differ and any(s.plan.pushed for s in scan.sweeps):
        found.append(_two_ways(scan, differ[0]))
    return tuple(sorted((f for f in found if f is not None), key=lambda f: f.sd))


def _lines(
    scan: Scan, sweep: Sweep, kind: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """(lines, samples) moments in plate order along the trace, NaN off the land; their places and whiskers."""
    columns = np.flatnonzero(np.asarray(scan.kind) == kind)
    lead = sweep.plan.n_lead
    moment = calibrated_moments(scan, sweep)[:, columns, lead : sweep.plan.n_samples - lead]
    flags = sweep.flags[:, columns, lead : sweep.plan.n_samples - lead]
    lines = np.where(flags & UNUSABLE, np.nan, moment).reshape(-1, moment.shape[2])
    place = sweep.plan.line_mm[:, columns].ravel()
    whisker = np.tile(np.arange(columns.size), moment.shape[0])
    order = np.argsort(place, kind="stable")
    lines, place, whisker = lines[order], place[order], whisker[order]
    if sweep.plan.direction.backward:
        lines = lines[:, ::-1]
    if sweep.plan.pushed:
        return lines, place, whisker  # where land is, the dragged sweep knows: this one may have jammed
    # each whisker has its own gain, so each has its own land
    for w in np.unique(whisker):
        rows = np.flatnonzero((whisker == w) & np.isfinite(lines).any(axis=1))
        if rows.size:
            off = np.abs(lines[rows] / plate_land(lines[rows]) - 1.0) > LAND_BAND
            lines[rows] = np.where(off, np.nan, lines[rows])
    return lines, place, whisker


def _medians(
    one: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Median land moments of two sets of lines over the samples that are land in both; which lines have enough."""
    both = np.isfinite(one) & np.isfinite(other)
    enough = both.sum(axis=1) >= FEWEST_SAMPLES
    a, b = (np.where(both, v, np.nan)[enough] for v in (one, other))
    return np.nanmedian(a, axis=1), np.nanmedian(b, axis=1), enough


def _conclude(per_whisker: dict[tuple[int, int], float], route: FrictionRoute) -> LandFriction | None:
    """Mean over whiskers; each was asked in several sweeps, which share its gain and so count once."""
    whiskers = sorted({w for _, w in per_whisker})
    each = [np.mean([mu for (_, w), mu in per_whisker.items() if w == whisker]) for whisker in whiskers]
    values = np.array([v for v in each if np.isfinite(v)])
    if not values.size:
        return None
    sd = float(values.std(ddof=1) / np.sqrt(values.size)) if values.size > 1 else float("inf")
    return LandFriction(mu=max(0.0, float(values.mean())), sd=sd, route=route)


def _by_shapes(scan: Scan, differ: int, profile: int) -> LandFriction | None:
    found: dict[tuple[int, int], float] = {}
    tips = scan.touches[differ].tip, scan.touches[profile].tip
    # the same lift is asked of both: moments per mm of preload
    preload = scan.touches[differ].preload_mm, scan.touches[profile].preload_mm
    for number, sweep in enumerate(scan.sweeps):
        if sweep.plan.pushed:
            continue
        one, place, whisker = _lines(scan, sweep, differ)
        other, places, _ = _lines(scan, sweep, profile)
        if place.shape != places.shape or not np.allclose(place, places):
            raise MapError("the rows of the array do not run on the same lines")
        a, b, enough = _medians(one, other)
        mu = friction_from_shapes(a / preload[0], b / preload[1], differentiator=tips[0], profiler=tips[1])
        for w in np.unique(whisker[enough]):
            found[number, int(w)] = float(np.nanmedian(mu[whisker[enough] == w]))
    return _conclude(found, FrictionRoute.SHAPES)


def _two_ways(scan: Scan, kind: int) -> LandFriction | None:
    found: dict[tuple[int, int], float] = {}
    tip = scan.touches[kind].tip
    pushed = {s.plan.direction: s for s in scan.sweeps if s.plan.pushed}
    for number, sweep in enumerate(scan.sweeps):
        back = next((s for d, s in pushed.items() if (int(d) - int(sweep.plan.direction)) % 360 == 180), None)
        if sweep.plan.pushed or back is None or back.plan.line_mm.shape != sweep.plan.line_mm.shape:
            continue
        one, place, whisker = _lines(scan, sweep, kind)
        other, places, _ = _lines(scan, back, kind)
        if not np.allclose(place, places) or one.shape != other.shape:
            continue
        a, b, enough = _medians(one, other)
        mu = friction_from_two_ways(a, b, tip)
        for w in np.unique(whisker[enough]):
            found[number, int(w)] = float(np.nanmedian(mu[whisker[enough] == w]))
    return _conclude(found, FrictionRoute.TWO_WAYS)
