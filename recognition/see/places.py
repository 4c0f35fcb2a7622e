"""Positions of a line's characters, from the columns of its strip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.language.box import Box
from recognition.see.text_line import HEIGHT_ROWS, ROWS, TextLine

_WIDEST = 0.42
"""Greatest reach of a box to either side, character heights."""


def boxes_of(line: TextLine, columns: NDArray[np.float64]) -> tuple[Box, ...]:
    """Boxes of characters: half way to their neighbours, with the line's height."""
    if columns.size == 0:
        return ()
    columns = np.maximum.accumulate(columns)
    most = _WIDEST * HEIGHT_ROWS
    apart = np.diff(columns) / 2
    left = np.minimum(np.r_[most, apart], most)
    right = np.minimum(np.r_[apart, most], most)
    middle, half = 0.5 * (ROWS - 1), 0.5 * HEIGHT_ROWS
    sides = np.concatenate([columns - left, columns + right])
    corners = line.places_mm(sides, np.array([[middle - half], [middle + half]])).reshape(4, columns.size, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return tuple(
        Box(float(a[0]), float(a[1]), float(b[0]), float(b[1])) for a, b in zip(low, high, strict=True)
    )
