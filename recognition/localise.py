"""Where a line of characters may lie: its rotation and its band, from where something is felt at all.

Only hypotheses are made here; matching judges them. The *activity* is the square of the edge channels (of a
height map: of its slope), clipped so that one chip does not outweigh a character.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel

MAX_ROTATION_DEG = 10.0
ROTATION_STEP_DEG = 0.5
MIN_BAND_ROWS = 7
MIN_RELIEF_SHARE = 0.005
"""Of the character height: stamped marks are 3 to 5 % deep, the figures of a coin 1 %; shallower relief is texture."""

RUNS_DOWN = 1.5
"""How much further edges reach down than across, from which a line is taken to run up or down. A line of one
character is taken for upright: five of the built-in fonts have characters half as wide as high."""


@dataclass(frozen=True)
class Band:
    """A band that may hold one line.

    Attributes:
        middle_mm: of the band across the line, in the frame of the activity given.
        height_mm: character height it would mean.
    """

    middle_mm: float
    height_mm: float


def activity_of(layers: NDArray[np.float32]) -> NDArray[np.float64]:
    """Clipped sum of squares of edge channels, (rows, cols)."""
    activity = np.zeros(layers.shape[1:])
    for layer in layers:
        exact = layer.astype(np.float64)
        activity += exact * exact
    top, floor = percentile(activity, 97.0), percentile(activity, 50.0)
    return np.asarray(np.clip(activity - floor, 0.0, max(top - floor, 1e-300)))


def percentile(values: NDArray[np.floating], percent: float) -> float:
    """As numpy's, linear between two values, but by one partition: those of large maps take long."""
    flat = values.ravel()
    at = percent / 100.0 * (flat.size - 1)
    k = int(at)
    parted = np.partition(flat, k)
    low = float(parted[k])
    high = float(parted[k + 1 :].min()) if at > k else low
    return low + (high - low) * (at - k)


def runs_down(activity: NDArray[np.float64]) -> bool:
    """Whether the line of a plate (rows, cols) runs up or down rather than across."""
    return _reach(activity.sum(axis=1)) > RUNS_DOWN * _reach(activity.sum(axis=0))


def _reach(profile: NDArray[np.float64]) -> float:
    """Samples that hold nine tenths of a profile."""
    share = np.cumsum(profile) / max(float(profile.sum()), 1e-300)
    return float(np.searchsorted(share, 0.95) - np.searchsorted(share, 0.05))


def line_rotation_deg(activity: NDArray[np.float64]) -> float:
    """Rotation at which the activity gathers most sharply into rows, from +x towards +y; 0 when none stands out."""
    rows, cols = activity.shape
    strong = activity > 0.35 * activity.max()
    v, u = np.nonzero(strong)
    if v.size < 50:
        return 0.0
    if v.size > 6000:
        pick = np.linspace(0, v.size - 1, 6000).astype(np.int64)
        v, u = v[pick], u[pick]
    weight = activity[v, u]
    x, y = u - 0.5 * (cols - 1), v - 0.5 * (rows - 1)
    # the sweep across: a rotation moves the ends of the line by this many rows
    angles = np.arange(-MAX_ROTATION_DEG, MAX_ROTATION_DEG + 1e-9, ROTATION_STEP_DEG)
    sharp = np.empty(angles.size)
    _sharpness(x, y, weight, np.radians(angles), np.empty(x.size), np.empty(rows + cols + 2), sharp)
    best = int(np.argmax(sharp))
    level = sharp[len(angles) // 2]
    if sharp[best] < 1.06 * level:
        return 0.0
    if 0 < best < len(angles) - 1:
        before, at, after = sharp[best - 1 : best + 2]
        curve = before - 2.0 * at + after
        shift = 0.5 * (before - after) / curve if curve < 0.0 else 0.0
        return float(angles[best] + shift * ROTATION_STEP_DEG)
    return float(angles[best])


@kernel()
def _sharpness(x, y, weight, angles, at, profile, out):  # type: ignore[no-untyped-def]
    """(angles,) sum of squares of what is gathered in rows of a frame turned so; `at` and `profile` are room."""
    for n in range(angles.size):
        sin, cos = math.sin(angles[n]), math.cos(angles[n])
        low, high = np.inf, -np.inf
        for i in range(x.size):
            at[i] = cos * y[i] - sin * x[i]
            low, high = min(low, at[i]), max(high, at[i])
        rows = int(high - low) + 2
        for r in range(rows):
            profile[r] = 0.0
        for i in range(x.size):
            place = at[i] - low
            first = int(place)
            part = place - first
            profile[first] += weight[i] * (1.0 - part)
            profile[first + 1] += weight[i] * part
        total = 0.0
        for r in range(rows):
            total += profile[r] * profile[r]
        out[n] = total


def bands(activity: NDArray[np.float64], *, pitch_mm: float, most: int = 5) -> tuple[Band, ...]:
    """Bands of rows in which something is felt, most promising first.

    The profile of row sums is cut at several levels; each run of rows above a level is a band. Bands that differ
    by less than a tenth are one.
    """
    profile = activity.mean(axis=1)
    rows = profile.size
    width = max(1, rows // 60)
    smooth = np.convolve(
        np.pad(profile, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), mode="valid"
    )
    background = float(np.percentile(smooth, 5))
    # on a wide plate most rows are land: then the strongest rows say what a line is like
    typical = max(float(np.percentile(smooth, 75)), 0.5 * float(smooth.max())) - background
    if typical <= background:
        return ()  # as busy everywhere: texture, or no land around the line
    found: list[tuple[float, Band]] = []
    for level in (0.15, 0.3, 0.5, 0.7):
        above = smooth - background > level * typical
        edges = np.flatnonzero(np.diff(np.concatenate([[0], above.astype(np.int8), [0]])))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if stop - start < max(MIN_BAND_ROWS, rows // 30):
                continue
            first = _crossing(smooth - background, start, level * typical)
            last = _crossing((smooth - background)[::-1], rows - stop, level * typical)
            height = (rows - 1 - last) - first
            band = Band(
                middle_mm=float(0.5 * (first + rows - 1 - last) * pitch_mm),
                height_mm=float(max(height, 1.0) * pitch_mm),
            )
            merit = float(np.minimum(smooth[start:stop] - background, typical).sum())
            if not any(_alike(band, other) for _, other in found):
                found.append((merit, band))
    found.sort(key=lambda item: -item[0])
    return tuple(band for _, band in found[:most])


def _crossing(values: NDArray[np.float64], index: int, level: float) -> float:
    """Row, with fraction, where the values first rise through the level, just before `index`."""
    if index == 0:
        return 0.0
    low, high = values[index - 1], values[index]
    return float(index - (high - level) / max(high - low, 1e-300))


def _alike(a: Band, b: Band) -> bool:
    near = abs(a.middle_mm - b.middle_mm) < 0.1 * max(a.height_mm, b.height_mm)
    return near and abs(math.log(a.height_mm / b.height_mm)) < 0.1
