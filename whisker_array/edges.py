"""Scan -> EdgeMap, directly from the moment signal: m / m_land - 1 and no filter of any kind.

All that is removed is what the land itself shows: offset (array lifted), gain of each whisker, drift of each
line, tilt of the part. What remains is (1 + h/d0) F(slope, mu) - 1, the paper's enhancement.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import EdgeMap, MapError, TraceDirection
from whisker_array.land import line_drift, plate_land, whisker_gain
from whisker_array.registration import registration_mm
from whisker_array.scan import Scan, Sweep
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


def averaging(position: NDArray[Any], pixel: NDArray[Any], pitch: float) -> Any:
    """Sparse (pixels, samples) weights of a triangle one pixel (or one step, if larger) wide to each side."""
    from scipy import sparse

    order = np.argsort(position, kind="stable")
    ordered = position[order]
    step = float(np.median(np.diff(ordered))) if position.size > 1 else pitch
    reach = max(pitch, step) * (1.0 + 1e-6)
    first, last = np.searchsorted(ordered, pixel - reach), np.searchsorted(ordered, pixel + reach)
    count = last - first
    row = np.repeat(np.arange(pixel.size), count)
    col = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    weight = np.clip(1.0 - np.abs(pixel[row] - ordered[col]) / reach, 0.0, None)
    return sparse.csr_array((weight, (row, order[col])), shape=(pixel.size, position.size))


def _land_ratio(
    scan: Scan, sweep: Sweep, *, ideal: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Enhancement of the usable lines, ascending, (lines, samples) with NaN, their places and positions."""
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
        return lines / scan.touch.land_moment_n_mm() - 1.0, place, position
    if scan.calibration is None:
        lines = lines / whisker_gain(lines, whisker)[:, None]
    land = plate_land(lines)
    if not np.isfinite(land).all() or np.median(np.abs(land)) == 0.0:
        raise MapError(f"the {int(sweep.plan.direction)}° sweep shows no land: every moment is zero")
    ratio = lines / land
    return ratio / line_drift(ratio) - 1.0, place, position


def _layer(
    enhancement: NDArray[np.float64],
    along_mm: NDArray[np.float64],
    across_mm: NDArray[np.float64],
    *,
    pixel_along: NDArray[np.float64],
    pixel_across: NDArray[np.float64],
    pitch_mm: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Enhancement (lines, samples) averaged onto the grid, (across, along), with its validity."""
    weights_along = averaging(along_mm, pixel_along, pitch_mm)
    weights_across = averaging(across_mm, pixel_across, pitch_mm)
    known = np.isfinite(enhancement)

    def spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
        result: NDArray[np.float64] = weights_across @ (weights_along @ values.T).T
        return result

    expected = weights_across.sum(axis=1)[:, None] * weights_along.sum(axis=1)[None, :]
    if known.all():
        weight, total = expected, spread(enhancement)
    else:
        weight, total = spread(known.astype(np.float64)), spread(np.where(known, enhancement, 0.0))
    valid = (weight > 0.5 * expected) & (expected > 0.0)
    return np.where(valid, total / np.maximum(weight, 1e-12), 0.0), valid


def edge_map(scan: Scan, *, register: bool = True, ideal: bool = False) -> EdgeMap:
    """The signed enhancement of a scan on a grid of its line pitch, one layer per trace direction.

    Args:
        scan: raw or calibrated.
        register: take off play between back-and-forth and crossed passes where the maps show it.
        ideal: the land's moment is the nominal one of the touch, as in a prediction; nothing is estimated.

    Raises:
        MapError: a sweep without usable samples or without land.
    """
    felt = [(sweep, *_land_ratio(scan, sweep, ideal=ideal)) for sweep in scan.sweeps]
    pitch = scan.line_pitch_mm
    spans_x, spans_y = [], []
    for sweep, _, place, along in felt:
        spans = (along, place) if sweep.plan.direction.along_x else (place, along)
        spans_x.append((spans[0].min(), spans[0].max()))
        spans_y.append((spans[1].min(), spans[1].max()))
    x0, x1 = max(s[0] for s in spans_x), min(s[1] for s in spans_x)
    y0, y1 = max(s[0] for s in spans_y), min(s[1] for s in spans_y)
    if x1 - x0 < pitch or y1 - y0 < pitch:
        raise MapError("the sweeps of the scan do not overlap on the plate")
    x = x0 + pitch * np.arange(int((x1 - x0) / pitch + 1e-6) + 1)
    y = y0 + pitch * np.arange(int((y1 - y0) / pitch + 1e-6) + 1)

    def grid(
        shift: dict[TraceDirection, tuple[float, float]],
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.bool_]]:
        layers, valid = [], np.ones((y.size, x.size), dtype=np.bool_)
        for sweep, enhancement, place, along in felt:
            dx, dy = shift.get(sweep.plan.direction, (0.0, 0.0))
            along_x = sweep.plan.direction.along_x
            layer, good = _layer(
                enhancement,
                along + (dx if along_x else dy),
                place + (dy if along_x else dx),
                pixel_along=x if along_x else y,
                pixel_across=y if along_x else x,
                pitch_mm=pitch,
            )
            layers.append(layer if along_x else layer.T)
            valid &= good if along_x else good.T
        return layers, valid

    layers, valid = grid({})
    if register and not ideal and len(felt) > 1:
        shift = registration_mm(layers, scan.directions, touch=scan.touch, pitch_mm=pitch)
        if shift:
            layers, valid = grid(shift)
    stack = np.stack([np.where(valid, layer, 0.0) for layer in layers]).astype(np.float32)
    return EdgeMap(
        enhancement=stack,
        directions=scan.directions,
        valid=valid,
        pitch_mm=pitch,
        origin_mm=(float(x[0]), float(y[0])),
    )
