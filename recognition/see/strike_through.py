"""A line through the serial, as one strikes out what no longer counts: it crosses the gaps between the characters, too.

|  /   ---      -|--/---/---\\--
| /     /        | /     /         in every gap, at one height: mark where there is land above and below
|/     /         |/     /
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.see.view import GREY, HEIGHTS, View, ViewKind

ZOOM = 2.0
_ROWS = HEIGHT_ROWS * ZOOM
"""Rows per character height of the strip that is looked at."""


def strike_through(
    view: View,
    line: TextLine,
    columns: NDArray[np.float64],
    *,
    within: float = 0.3,
    beside: float = 0.18,
    most_gaps_without: float = 0.2,
    fewest: int = 4,
) -> float:
    """How much of the characters' own contrast a line through all gaps has; 0 with few characters.

    The line stays `within` character heights of the middle, and rises no more, with land `beside` it above and below.
    `columns` are (places,) in the line's strip.
    """
    values = view.strip(line, zoom=ZOOM)[HEIGHTS if view.kind is ViewKind.FELT else GREY]
    places, middle = ZOOM * columns, 0.5 * (values.shape[0] - 1)
    if places.size < fewest or not values.any():
        return 0.0
    band = slice(int(middle - 0.5 * _ROWS), int(middle + 0.5 * _ROWS) + 1)
    far = np.abs(values - np.median(values[band]))
    usual = np.median([np.quantile(_columns(far[band], x, 0.3), 0.9) for x in places])
    gaps = 0.5 * (places[:-1] + places[1:])
    profiles = np.array([np.median(_columns(far, x, 0.03), axis=1) for x in gaps])
    along = (gaps - gaps.mean()) / max(float(np.ptp(gaps)), 1.0)
    heights, rises = np.arange(-within, within + 0.01, 1.0 / _ROWS), np.arange(-within, within + 0.01, 0.06)
    step = int(beside * _ROWS)
    rows = np.rint(middle + _ROWS * (heights[:, None, None] + rises[:, None] * along)).astype(np.intp)
    rows = np.clip(rows, step, profiles.shape[1] - step - 1)

    def at(shift: int) -> NDArray[np.float32]:
        return np.asarray(profiles[np.arange(gaps.size), rows + shift])

    # (heights, rises, gaps)
    crossed = np.max([at(-1), at(0), at(1)], axis=0) - np.maximum(at(-step), at(step))
    share = np.quantile(crossed, most_gaps_without, axis=-1, method="lower").max()
    return max(float(share / max(float(usual), 1e-6)), 0.0)


def _columns(rows: NDArray[np.float32], middle: float, reach: float) -> NDArray[np.float32]:
    low = max(round(middle - reach * _ROWS), 0)
    return rows[:, low : max(round(middle + reach * _ROWS), low) + 1]
