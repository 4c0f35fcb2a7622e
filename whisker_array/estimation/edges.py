"""Scan -> EdgeMap, directly from the moment signal: m / m_land - 1 and no filter of any kind. Only errors that the land
itself shows are removed: offset, gain of each whisker, drift of each line, tilt of the part."""

from __future__ import annotations

import numpy as np

from glyphs.surface.maps import EdgeMap, MapError, TraceDirection
from whisker_array.arrays import Floats
from whisker_array.estimation.crossing import fill_from_crossing
from whisker_array.estimation.gridding import SweptLines, common_grid, on_grid
from whisker_array.estimation.land import land_coefficients, land_surface, remove_drift, whisker_gain
from whisker_array.estimation.registration import registration_mm
from whisker_array.scan.calibration import apply_calibration
from whisker_array.scan.scan import Scan, only
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag

UNUSABLE = np.uint8(0xFF & ~SampleFlag.SATURATED)


def calibrated_moments(scan: Scan, sweep: Sweep) -> Floats:
    """Moments (passes, whiskers, samples), N mm, less the median of their pass's air, without gain if it is known."""
    raw, air = np.asarray(sweep.moment_n_mm), sweep.air_n_mm
    if scan.calibration is not None:
        raw, air = (apply_calibration(signal, scan.calibration) for signal in (raw, air))
    moment = raw.astype(np.float64)
    if air.shape[2]:
        moment -= np.median(air, axis=2, keepdims=True)
    return moment


def usable_moments(scan: Scan, sweep: Sweep) -> Floats:
    """`calibrated_moments`, NaN at samples flagged as unusable."""
    moment = calibrated_moments(scan, sweep)
    moment[(sweep.flags & UNUSABLE) != 0] = np.nan
    return moment


def land_ratio(scan: Scan, sweep: Sweep, *, ideal: bool = False) -> SweptLines:
    """Enhancement m / m_land - 1 of the usable lines of a sweep, ascending, without lead-in. Raises MapError."""
    moment, lead = usable_moments(scan, sweep), sweep.plan.n_lead
    order, whisker, place = sweep.plan.lines_in_order()
    within = slice(lead, max(moment.shape[2] - lead, lead))
    lines = moment.reshape(-1, moment.shape[2])[order, within]
    keep = np.asarray(np.isfinite(lines).any(axis=1))
    # lines of an excluded whisker stay as unknown: crossing passes may fill them
    faulty = ((sweep.flags & np.uint8(SampleFlag.FAULTY)) != 0).all(axis=2).ravel()[order]
    listed = np.asarray(keep | faulty)
    values = np.full((np.count_nonzero(listed), lines.shape[1]), np.nan)
    if keep.sum() < 2:
        raise MapError(
            f"no usable samples in the {int(sweep.plan.direction)}° sweep: "
            + SampleFlag(int(np.bitwise_or.reduce(sweep.flags, axis=None))).describe()
        )
    lines, whisker = lines[keep], whisker[keep]
    if ideal:
        lines /= scan.touch.land_moment_n_mm()
    else:
        if scan.calibration is None:
            lines /= whisker_gain(lines, whisker)[:, None]
        land = land_coefficients(lines)
        if not np.isfinite(land).all() or not land.any():
            raise MapError(f"the {int(sweep.plan.direction)}° sweep shows no land: every moment is zero")
        lines /= land_surface(land, lines.shape)
        remove_drift(lines)
    values[keep[listed]] = lines - 1.0
    return SweptLines(values, place[listed], sweep.plan.position_mm()[within], sweep.plan.direction)


def edge_map(
    scan: Scan,
    *,
    register: bool = True,
    ideal: bool = False,
    within_mm: tuple[float, float, float, float] | None = None,
) -> EdgeMap:
    """The signed enhancement of a scan on a grid of its line pitch, one layer per trace direction. Raises MapError.

    Only the first kind of whisker is used, dragged. `register` removes play between back-and-forth and crossed passes.
    `ideal` uses the nominal land moment of the touch; nothing is estimated. The map lies within (x0, y0, x1, y1) of the
    plate frame, if given.
    """
    scan = only(scan)
    swept = [land_ratio(scan, sweep, ideal=ideal) for sweep in scan.sweeps]
    grid = common_grid(swept, scan.line_pitch_mm, within_mm=within_mm)
    layers, known = on_grid(swept, grid)
    if register and not ideal and len(swept) > 1:
        shift = registration_mm(layers, scan.directions, touch=scan.touch, pitch_mm=grid.pitch_mm)
        if shift:
            layers, known = on_grid(swept, grid, shift=shift)
    if any((s.flags & np.uint8(SampleFlag.FAULTY)).any() for s in scan.sweeps):
        layers, known = fill_from_crossing(
            layers, known, scan.directions, touch=scan.touch, pitch_mm=grid.pitch_mm
        )
    valid = np.logical_and.reduce(known)
    return EdgeMap(
        enhancement=np.where(valid, layers, 0.0).astype(np.float32),
        directions=scan.directions,
        valid=valid,
        pitch_mm=grid.pitch_mm,
        origin_mm=grid.origin_mm,
    )


def play_between(scan: Scan) -> dict[TraceDirection, tuple[float, float]]:
    """Plate shift (dx, dy) of each dragged direction that removes the stage's play; empty without play."""
    scan = only(scan)
    swept = [land_ratio(scan, sweep) for sweep in scan.sweeps]
    grid = common_grid(swept, scan.line_pitch_mm)
    layers, _ = on_grid(swept, grid)
    return registration_mm(layers, scan.directions, touch=scan.touch, pitch_mm=grid.pitch_mm)
