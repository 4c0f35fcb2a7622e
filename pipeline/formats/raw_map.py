"""Heights as a file holds them: returned by every reader, made a map by `pipeline.formats.grids`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.settings import MapSettings


@dataclass(frozen=True)
class RawMap:
    """Heights on a grid in the numbers of their file.

    Attributes:
        z: (rows, cols) heights; NaN for dropouts.
        x_pitch: distance of columns; None where the file does not state it.
        y_pitch: distance of rows; None likewise.
        z_mm: millimetres in one unit of `z`, as the file or its format states; None where neither does.
        xy_mm: millimetres in one unit of the pitches, likewise.
        bottom_first: the first row of `z` is the lowest one of the part, as a reader sees it.
        one_unit: heights and distances have one unit, as the coordinates of a mesh.
        rows_stated: the file states which row is first, or every writer of its format has the same one first.
    """

    z: NDArray[np.number]
    x_pitch: float | None = None
    y_pitch: float | None = None
    z_mm: float | None = None
    xy_mm: float | None = None
    bottom_first: bool = False
    rows_stated: bool = False
    one_unit: bool = False

    def is_bottom_first(self, settings: MapSettings) -> bool:
        """Whether the first row is the lowest one, by the settings where they say so."""
        return self.bottom_first if settings.rows is None else settings.rows == "bottom-first"
