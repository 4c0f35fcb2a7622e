"""Profiler and differentiator in one array: height, slope and friction of every sample.

A profiler and a differentiator trace the same line, dragged either way or pushed back::

    profiler          m / m_land = lift / d0                      the height, for any slope and friction
    differentiator    m = lift G(theta)                           theta = s tau + e phi of `estimate`
                      s = +1, -1: base ahead in +x, -x;  e = +1, -1: dragged, pushed

Sweeps with different products s e give tau and phi by least squares; otherwise phi is that of the land, and only tau is
solved for. In contact each tip is deflected along the trace by its own force, so every sample is moved to the
position of its tip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import EdgeMap, MapError, TraceDirection
from whisker_array.arrays import Floats
from whisker_array.estimation.edges import edge_map, land_ratio, play_between
from whisker_array.estimation.estimate import is_profiler, lean_from_moment, moment_per_lift, tip_shift_mm
from whisker_array.estimation.friction import USABLE_SD, LandFriction, land_friction
from whisker_array.estimation.gridding import PlateGrid, SweptLines, common_grid, on_grid
from whisker_array.estimation.relief import (
    STEEPEST,
    Relief,
    Route,
    move_to_tips,
    relief_from_edges,
)
from whisker_array.scan.scan import Scan, only
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.simulation.regrid import mean_of_known
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.touch import Touch

LEAST_GIVE = 0.5
"""Least give of a pushed tip, relative to that on frictionless land; with less it snags before it jams."""
ROUNDS = 4
"""Iterations between tip positions and leans; each changes them at most a tenth as much as the previous one."""


def estimate_relief(scan: Scan, edges: EdgeMap | None = None) -> Relief:
    """Estimate height and slopes of the surface by the best route that the scan allows. Raises MapError."""
    known = next((f for f in land_friction(scan) if f.sd < USABLE_SD), None)
    profiler = next((i for i, touch in enumerate(scan.touches) if is_profiler(touch.tip)), None)
    differentiator = next((i for i, touch in enumerate(scan.touches) if not is_profiler(touch.tip)), None)
    if profiler is None or differentiator is None:
        edges = edges if edges is not None else edge_map(scan)
        mu = known.mu if known else None
        relief = relief_from_edges(edges, scan.touch, friction=mu)
        if scan.fidelity != Fidelity.POINTWISE.value and relief.route is Route.TURNED:
            for _ in range(ROUNDS):
                relief = relief_from_edges(move_to_tips(edges, scan.touch, relief), scan.touch, friction=mu)
        return replace(relief, friction_sd=known.sd if known else None)
    return _profile_relief(scan, differentiator, profiler, known)


@dataclass(frozen=True, eq=False)
class _View:
    lift: SweptLines
    lean: SweptLines
    base_ahead: float
    friction_sign: float


def _profile_relief(scan: Scan, differentiator: int, profiler: int, known: LandFriction | None) -> Relief:
    touch = scan.touches[differentiator]
    mu = known.mu if known else touch.friction
    slopes_of, profiles_of = (only(scan, kind=k, pushed=None) for k in (differentiator, profiler))
    views = [
        _view(slopes_of, profiles_of, number, mu=mu, bent=scan.fidelity != Fidelity.POINTWISE.value)
        for number, sweep in enumerate(scan.sweeps)
        if not (sweep.plan.pushed and _has_jammed(sweep))
    ]
    grid = common_grid([v.lift for v in views], scan.line_pitch_mm)
    shift = play_between(slopes_of)
    # the height is from dragged sweeps, because a pushed tip jams sooner on a steep wall
    dragged = [_map(v.lift, grid, shift) for v in views if v.friction_sign > 0.0]
    height = mean_of_known(np.stack(dragged), axis=0) - profiles_of.touch.preload_mm
    slopes: dict[int, NDArray[np.float32]] = {}
    frictions = []
    for axis, along_x in enumerate((True, False)):
        chosen = [v for v in views if v.lift.direction.along_x is along_x]
        if not chosen:
            continue
        leans = [_map(v.lean, grid, shift) for v in chosen]
        phi_land = float(np.arctan(mu))
        of_dragged = [m if v.friction_sign > 0.0 else m * np.nan for v, m in zip(chosen, leans, strict=True)]
        rough, _ = _solve(chosen, of_dragged, phi_land)
        leans = [
            _without_snags(v, lean, rough, phi_land, (slopes_of.touch, profiles_of.touch))
            for v, lean in zip(chosen, leans, strict=True)
        ]
        tau, phi = _solve(chosen, leans, phi_land)
        slopes[axis] = np.clip(np.tan(tau), -STEEPEST, STEEPEST).astype(np.float32)
        if known is not None and np.isfinite(phi).any():
            frictions.append(np.tan(phi))
    return Relief(
        height_mm=height.astype(np.float32),
        slope_x=slopes.get(0),
        slope_y=slopes.get(1),
        pitch_mm=grid.pitch_mm,
        origin_mm=grid.origin_mm,
        friction=mu,
        friction_sd=known.sd if known else None,
        route=Route.PROFILED,
        friction_map=mean_of_known(np.stack(frictions), axis=0).astype(np.float32) if frictions else None,
    )


def _map(swept: SweptLines, grid: PlateGrid, shift: Mapping[TraceDirection, tuple[float, float]]) -> Floats:
    (layer,), (good,) = on_grid([swept], grid, shift=shift)
    return np.where(good, layer, np.nan)


def _solve(views: Sequence[_View], leans: Sequence[Floats], phi_land: float) -> tuple[Floats, Floats]:
    s = np.array([view.base_ahead for view in views])[:, None, None]
    e = np.array([view.friction_sign for view in views])[:, None, None]
    known = np.isfinite(leans)
    theta = np.where(known, leans, 0.0)
    ss, se, st, et = (terms.sum(axis=0) for terms in (1.0 * known, known * s * e, s * theta, e * theta))
    det = ss * ss - se * se  # s^2 = e^2 = 1
    both = det > 0.5
    safe = np.where(both, det, 1.0)
    phi = np.where(both, (ss * et - se * st) / safe, np.nan)
    tau = np.where(both, (ss * st - se * et) / safe, (st - se * phi_land) / np.maximum(ss, 1.0))
    return np.where(ss > 0, tau, np.nan), phi


def _has_jammed(sweep: Sweep, *, most: float = 0.05) -> bool:
    on_plate = (sweep.flags & np.uint8(SampleFlag.OUTSIDE)) == 0
    jammed = (sweep.flags & np.uint8(SampleFlag.JAMMED | SampleFlag.CONTACT_LOST)) != 0
    return bool((jammed & on_plate).sum() > most * on_plate.sum())


def _without_snags(
    view: _View, lean: Floats, tau: Floats, phi_land: float, touches: tuple[Touch, Touch]
) -> Floats:
    if view.friction_sign > 0.0:
        return lean
    t = np.tan(np.clip(view.base_ahead * tau - phi_land, -1.55, 1.55))
    rows = (touch.tip.compliance_mm_per_n[1] for touch in touches)
    give = [1.0 - row[0] / row[1] * t for row in rows]
    return np.where(np.minimum(*give) > LEAST_GIVE, lean, np.nan)


def _view(slopes_of: Scan, profiles_of: Scan, number: int, *, mu: float, bent: bool) -> _View:
    sloped, other = (land_ratio(s, s.sweeps[number]) for s in (slopes_of, profiles_of))
    rows = np.isin(np.round(sloped.place_mm, 6), np.round(other.place_mm, 6))
    rows_too = np.isin(np.round(other.place_mm, 6), np.round(sloped.place_mm, 6))
    if not rows.any():
        raise MapError("the rows of the array do not run on the same lines")
    plan = slopes_of.sweeps[number].plan
    e = -1.0 if plan.pushed else 1.0
    s = e * plan.direction.sign
    phi = e * float(np.arctan(mu))
    along = s * sloped.along_mm  # increases towards the base
    moment = (1.0 + sloped.values[rows]) * float(moment_per_lift(phi, slopes_of.touch.tip))
    moment *= slopes_of.touch.preload_mm
    lift = (1.0 + other.values[rows_too]) * profiles_of.touch.preload_mm
    where_m = where_l = np.broadcast_to(along, moment.shape)
    lean_l = np.full(lift.shape, phi)
    lean = np.full(moment.shape, phi)
    for _ in range(ROUNDS):
        if bent:
            where_l = along + _tip_shift(lean_l, lift, profiles_of.touch, e)
            where_m = along + _tip_shift(lean, _resample(lift, where_l, where_m), slopes_of.touch, e)
        lean = lean_from_moment(moment, _resample(lift, where_l, where_m), slopes_of.touch.tip)
        lean_l = _resample(lean, where_m, where_l)
    even = np.broadcast_to(along, lift.shape)
    lifts, leans = _resample(lift, where_l, even), _resample(lean, where_m, even)
    # missing samples stay unknown
    lifts, leans = np.where(np.isfinite(lift), lifts, np.nan), np.where(np.isfinite(moment), leans, np.nan)
    return _View(
        lift=SweptLines(lifts, other.place_mm[rows_too], sloped.along_mm, sloped.direction),
        lean=SweptLines(leans, sloped.place_mm[rows], sloped.along_mm, sloped.direction),
        base_ahead=s,
        friction_sign=e,
    )


def _tip_shift(lean: Floats, lift: Floats, touch: Touch, friction_sign: float) -> Floats:
    tip = touch.tip if friction_sign > 0.0 else touch.tip.pushed()
    lag = friction_sign * land_lag_mm(tip, preload_mm=touch.preload_mm, friction=touch.friction)
    shift = tip_shift_mm(lean, lift, touch.tip) - lag
    return np.where(np.isfinite(shift), shift, 0.0)


def _resample(values: Floats, known_at: Floats, wanted: Floats) -> Floats:
    if known_at is wanted:
        return values
    out = np.empty(values.shape)
    for i in range(values.shape[0]):
        known = np.isfinite(values[i])
        order = np.argsort(known_at[i][known], kind="stable")
        if order.size < 2:
            out[i] = np.nan
            continue
        out[i] = np.interp(wanted[i], known_at[i][known][order], values[i][known][order])
    return out
