"""Refit a line to its ink: bend, rotation and height follow from the positions of its characters.

strip, taller than the line --slopes--> middle and spread of the ink at each place --robust parabola--> line

          A B C                      offsets of the places from the line, heights:
    9 .-'       '-. 0                  + 0.3   - 0.1   - 0.1   + 0.3
---------------------- line as found   bent by them, the line runs along the characters
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine, moved_across, points_along
from recognition.see.view import GREY, HEIGHTS, KNOWN, View

Floats = NDArray[np.float64]


def on_ink(
    view: View,
    line: TextLine,
    columns: Floats,
    *,
    height_known: bool = False,
    rows: int = 52,
    half_place: float = 0.35,
    # standard deviation of ink down a character, heights: of clean characters of three fonts, at their true
    # positions
    usual_spread: float = 0.31,
    least_off: float = 0.15,
    least_change: float = 0.12,  # least change of the logarithm of the height; fonts differ by less
    most_size: float = 1.35,
    land_percent: float = 60.0,
    edge_percent: float = 98.0,
    scatter: float = 0.05,
    least_sag: float = 0.03,
) -> tuple[TextLine, ...]:
    """Move, turn and bend a line onto its ink: none if there is nothing to move, two if the ink has another height."""
    offsets, spreads = _ink(view.strip(line, rows=rows), columns, half_place, land_percent, edge_percent)
    seen = np.isfinite(offsets)
    if not seen.any():
        return ()
    shares = np.linspace(0.0, 1.0, 33)
    along = ((shares * line.length_mm / line.height_mm) + MARGIN) * HEIGHT_ROWS
    off = _parabola(columns[seen], offsets[seen], along, scatter)
    size = float(np.clip(np.median(spreads[seen]) / usual_spread, 1.0 / most_size, most_size))
    right_size = height_known or abs(np.log(size)) < least_change
    within = (along >= columns[0]) & (along <= columns[-1])
    if right_size and np.abs(off[within]).max(initial=0.0) < least_off:
        return ()
    points = moved_across(points_along(line, shares), off * line.height_mm)
    chord = np.linspace(points[0], points[-1], len(points))
    if np.linalg.norm(points - chord, axis=1).max() < least_sag * line.height_mm:
        points = points[[0, -1]]
    laid = TextLine(points, line.height_mm)
    return (laid,) if right_size else (laid, TextLine(points, line.height_mm * size))


def _ink(
    strip: NDArray[np.float32], columns: Floats, half: float, land_percent: float, edge_percent: float
) -> tuple[Floats, Floats]:
    surface = strip[HEIGHTS] if strip[HEIGHTS].any() else strip[GREY]
    slope = np.hypot(*np.gradient(surface)) * strip[KNOWN]
    land, most = np.percentile(slope, (land_percent, edge_percent))
    ink = np.clip(slope, land, max(most, land)) - land
    down = (np.arange(ink.shape[0]) - 0.5 * (ink.shape[0] - 1)) / HEIGHT_ROWS
    middles, spreads = np.full(columns.size, np.nan), np.full(columns.size, np.nan)
    for k, column in enumerate(columns):
        low, high = np.clip(
            np.rint([column - half * HEIGHT_ROWS, column + half * HEIGHT_ROWS]), 0, ink.shape[1]
        )
        weight = ink[:, int(low) : int(high)].sum(axis=1)
        if weight.sum() > 0.0:
            middles[k] = np.average(down, weights=weight)
            spreads[k] = np.sqrt(np.average((down - middles[k]) ** 2, weights=weight))
    return middles, spreads


def _parabola(columns: Floats, offsets: Floats, along: Floats, scatter: float) -> Floats:
    from scipy.optimize import least_squares

    degree = min(2, max(0, (columns.size - 1) // 2))
    middle, half = columns.mean(), max(float(np.ptp(columns)) / 2, 1.0)
    powers = np.vander((columns - middle) / half, degree + 1)
    start = np.linalg.lstsq(powers, offsets, rcond=None)[0]
    fit = least_squares(lambda p: powers @ p - offsets, start, loss="soft_l1", f_scale=scatter)
    return np.asarray(np.vander((along - middle) / half, degree + 1) @ fit.x)
