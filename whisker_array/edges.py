"""Scan -> EdgeMap, directly from the moment signal: m / m_land - 1 and no filter of any kind.

All that is removed is what the land itself shows: offset (array lifted), gain of each whisker, drift of each
line, tilt of the part. What remains is (1 + h/d0) F(slope, mu) - 1, the paper's enhancement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import EdgeMap, MapError, TraceDirection
from whisker_array.gridding import FeltLines, common_grid, on_grid
from whisker_array.land import line_drift, plate_land, whisker_gain
from whisker_array.registration import registration_mm
from whisker_array.scan import Scan, Sweep, only
from whisker_array.sensor import apply_calibration
from whisker_array.traces import SampleFlag

UNUSABLE = np.uint8(
    SampleFlag.CONTACT_LOST
    | SampleFlag.JAMMED
    | SampleFlag.OUT_OF_RANGE
    | SampleFlag.OUTSIDE
    | SampleFlag.DROPOUT
    | SampleFlag.NOT_CONVERGED
)


def calibrated_moments(scan: Scan, sweep: Sweep) -> NDArray[np.float64]:
    """Moments (passes, whiskers, samples) with offset and, if known, gain removed, N mm.

    The offset is that of the pass's own air samples where there are any, so slow drift between passes goes
    too.
    """
    raw = np.asarray(sweep.moment_n_mm, dtype=np.float64)
    air = sweep.air_n_mm
    if scan.calibration is not None:
        raw = np.asarray(apply_calibration(raw, scan.calibration), dtype=np.float64)
        if air.shape[2]:
            air = apply_calibration(air, scan.calibration)
    if air.shape[2]:
        raw = raw - np.median(air, axis=2, keepdims=True)
    return raw


def land_ratio(scan: Scan, sweep: Sweep, *, ideal: bool = False) -> FeltLines:
    """Enhancement m / m_land - 1 of the usable lines of a sweep, ascending, lead-in and lead-out left off.

    Args:
        scan: of one kind of whisker.
        sweep: one of its sweeps.
        ideal: the land's moment is the nominal one of the touch; nothing is estimated.

    Raises:
        MapError: no usable samples, or no land.
    """
    moment = calibrated_moments(scan, sweep)
    moment = np.where(sweep.flags & UNUSABLE, np.nan, moment)
    lines = moment.reshape(-1, moment.shape[2])
    place = sweep.plan.line_mm.ravel()
    whisker = np.tile(np.arange(moment.shape[1]), moment.shape[0])
    lead = sweep.plan.n_lead
    core = slice(lead, lines.shape[1] - lead)
    keep = np.isfinite(lines[:, core]).any(axis=1)
    if keep.sum() < 2:
        raise MapError(
            f"no usable samples in the {int(sweep.plan.direction)}° sweep: "
            + SampleFlag(int(np.bitwise_or.reduce(sweep.flags, axis=None))).describe()
        )
    order = np.flatnonzero(keep)[np.argsort(place[keep], kind="stable")]
    lines, place, whisker = lines[order][:, core], place[order], whisker[order]
    position = sweep.plan.position_mm()[core]
    if ideal:
        return FeltLines(lines / scan.touch.land_moment_n_mm() - 1.0, place, position, sweep.plan.direction)
    if scan.calibration is None:
        lines = lines / whisker_gain(lines, whisker)[:, None]
    land = plate_land(lines)
    if not np.isfinite(land).all() or np.median(np.abs(land)) == 0.0:
        raise MapError(f"the {int(sweep.plan.direction)}° sweep shows no land: every moment is zero")
    ratio = lines / land
    return FeltLines(ratio / line_drift(ratio) - 1.0, place, position, sweep.plan.direction)


def edge_map(scan: Scan, *, register: bool = True, ideal: bool = False) -> EdgeMap:
    """The signed enhancement of a scan on a grid of its line pitch, one layer per trace direction.

    Of a mixed array the first kind of whisker is taken; sweeps pushed back are left aside.

    Args:
        scan: raw or calibrated.
        register: take off play between back-and-forth and crossed passes where the maps show it.
        ideal: the land's moment is the nominal one of the touch, as in a prediction; nothing is estimated.

    Raises:
        MapError: a sweep without usable samples or without land.
    """
    scan = only(scan)
    felt = [land_ratio(scan, sweep, ideal=ideal) for sweep in scan.sweeps]
    grid = common_grid(felt, scan.line_pitch_mm)
    layers, valid = on_grid(felt, grid)
    if register and not ideal and len(felt) > 1:
        shift = registration_mm(layers, scan.directions, touch=scan.touch, pitch_mm=grid.pitch_mm)
        if shift:
            layers, valid = on_grid(felt, grid, shift=shift)
    stack = np.stack([np.where(valid, layer, 0.0) for layer in layers]).astype(np.float32)
    return EdgeMap(
        enhancement=stack,
        directions=scan.directions,
        valid=valid,
        pitch_mm=grid.pitch_mm,
        origin_mm=grid.origin_mm,
    )


def play_between(scan: Scan) -> dict[TraceDirection, tuple[float, float]]:
    """Plate shift (dx, dy) of each dragged direction that takes off the stage's play; empty without play.

    Raises:
        MapError: as edge_map.
    """
    scan = only(scan)
    felt = [land_ratio(scan, sweep) for sweep in scan.sweeps]
    grid = common_grid(felt, scan.line_pitch_mm)
    layers, _ = on_grid(felt, grid)
    return registration_mm(layers, scan.directions, touch=scan.touch, pitch_mm=grid.pitch_mm)
