"""The unit of numbers in a file that states none, and the suspicion that it is not millimetres.

Die stamps, dot peen and coin dies leave marks 0.02 to 0.5 mm deep with characters 1 to 25 mm high. Numbers that no
plate with such marks can have in millimetres are asked about; numbers that might be right are taken as they stand.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError

MOST_PLATE_MM = 2000.0
"""Longer side of a map: the longest serial, 17 characters of 25 mm, takes 0.5 m."""
LEAST_PLATE_MM = 0.1
"""Shorter side: a tenth of the lowest lettering met, a coin's."""
MOST_RELIEF_MM = 100.0
"""Height range: what measures so much does not resolve a mark of 0.1 mm."""
MOST_RELIEF_SHARE = 1.0
"""Height range over the shorter side: no plate lies more than 45 degrees askew under an instrument."""
LEAST_RELIEF_MM = 1e-3
"""Height range of a map that is not flat: a twentieth of the shallowest mark, less than a plate's form."""
MOST_PITCH_MM = 10.0
"""Distance of samples: a character of 25 mm would have three."""


class Unit(StrEnum):
    """Unit of length."""

    UM = "um"
    MM = "mm"
    M = "m"
    INCH = "in"

    @property
    def mm(self) -> float:
        """Millimetres in one."""
        return {Unit.UM: 1e-3, Unit.MM: 1.0, Unit.M: 1e3, Unit.INCH: 25.4}[self]

    @property
    def plural(self) -> str:
        """In words."""
        return {Unit.UM: "micrometres", Unit.MM: "millimetres", Unit.M: "metres", Unit.INCH: "inches"}[self]


def factors_to_mm(path: Path, z: NDArray[np.generic], pitch: float, unit: Unit) -> tuple[float, float]:
    """What heights and sample distance are multiplied by to be millimetres.

    Heights and distances may have different units: those that the unit would make absurd, and that make sense as
    millimetres, stay millimetres.

    Args:
        path: the file, for the message.
        z: (rows, cols) heights as the file has them.
        pitch: distance of samples as the file has it, positive.
        unit: of the file.

    Raises:
        FileError: in this unit the numbers make no plate, in another they would.
    """
    relief = _range_of(z)
    fitting = _fitting(unit, relief, pitch, z.shape)
    if fitting is None:
        others = (u for u in Unit if u is not unit and _fitting(u, relief, pitch, z.shape) is not None)
        if other := next(others, None):
            absurd = _absurd(relief * unit.mm, pitch * unit.mm, z.shape)
            raise FileError(
                path, absurd, f"are the numbers {other.plural}, not {unit.plural}? then give --unit {other}"
            )
    return fitting or (unit.mm, unit.mm)


def _fitting(unit: Unit, relief: float, pitch: float, shape: tuple[int, ...]) -> tuple[float, float] | None:
    """Factors of heights and distances with which the numbers make a plate, if there are such."""
    for z_mm, pitch_mm in ((unit.mm, unit.mm), (unit.mm, 1.0), (1.0, unit.mm)):
        if not _absurd(relief * z_mm, pitch * pitch_mm, shape):
            return (z_mm, pitch_mm)
    return None


def _absurd(relief_mm: float, pitch_mm: float, shape: tuple[int, ...]) -> str:
    """Why no plate with marks has these measures; empty if one may."""
    shorter, longer = sorted(n * pitch_mm for n in shape)
    if pitch_mm > MOST_PITCH_MM:
        return f"its samples lie {pitch_mm:.4g} mm apart"
    if not (longer <= MOST_PLATE_MM and shorter >= LEAST_PLATE_MM):
        return f"the map measures {shape[1] * pitch_mm:.3g} x {shape[0] * pitch_mm:.3g} mm"
    if relief_mm > min(MOST_RELIEF_MM, MOST_RELIEF_SHARE * shorter) or 0.0 < relief_mm < LEAST_RELIEF_MM:
        return f"heights span {relief_mm:.3g} mm on {shape[1] * pitch_mm:.3g} x {shape[0] * pitch_mm:.3g} mm"
    return ""


def _range_of(z: NDArray[np.generic]) -> float:
    """Range of all but the outer 0.2 percents, of which some are an instrument's bad points; 0 where none is finite."""
    flat = np.asarray(z, dtype=np.float64).ravel()[:: max(1, z.size // 200_000)]
    flat = flat[np.isfinite(flat)]
    if not flat.size:
        return 0.0
    low, high = np.percentile(flat, [0.2, 99.8])
    return float(high - low)
