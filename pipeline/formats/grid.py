"""Conversion of the heights of a file to a HeightMap: bad points, rows, units, offset, and one pitch for both axes.

Die stamps, dot peen and coin dies leave marks 0.02 to 0.5 mm deep with characters 1 to 25 mm high. Numbers that fit no
such part in the file's unit, or that of the settings, are refused with a hint at the unit they fit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap
from pipeline.common.settings import MapSettings
from pipeline.errors import DataError
from pipeline.formats.raw_map import PROFILE, RawMap, check_size, without_bad_points, without_isolated_value

if TYPE_CHECKING:
    from recognition.surface import Surface

# mm, longer side of a map: twice the longest serial, 17 characters of 25 mm
MOST_PLATE_MM = 1000.0
# mm, shorter side of a map: a tenth of the smallest lettering, a coin's; a smaller limit where the file states its unit
LEAST_PLATE_MM, LEAST_STATED_MM = 0.1, 0.02
# mm, height range: an instrument with a larger range does not resolve a mark of 0.1 mm
MOST_RELIEF_MM = 100.0
# height range over the longer side: no plate lies more than 45 degrees askew under an instrument
MOST_RELIEF_SHARE = 1.0
# mm, height range of a map that is not flat: a twentieth of the shallowest mark
LEAST_RELIEF_MM = 1e-3
# mm, usual height range of a stamped plate: of several possible units the one nearest to it is the likeliest
USUAL_RELIEF_MM = 0.2
# least height range over the shorter side where the file states its unit: instruments measure unmarked parts, too
LEAST_RELIEF_SHARE = 3e-5
# mm, height range without tilt and dome: twenty times the deepest stamped mark
MOST_DEPTH_MM = 10.0
# mean steepness over a fiftieth of the shorter side: 45 degrees everywhere
MOST_STEEPNESS = 1.0
# mm, distance of samples: a character of 25 mm has 25
MOST_PITCH_MM = 1.0

_SUBSAMPLE = 40_000
# degrees between which a plane is a tilted part: a steeper one is a wrong unit; its share of all heights
_LEAST_TILT_DEG, _MOST_TILT_DEG, _PLANE_SHARE = 40.0, 70.0, 0.2
# height over width of the thin edge of a plate
_UPRIGHT = 20.0

# millimetres per unit of length, in the spelling of files
MM = {
    **{"nm": 1e-6, "um": 1e-3, "µm": 1e-3, "μm": 1e-3, "mm": 1.0},
    **{"cm": 10.0, "m": 1e3, "in": 25.4, "inch": 25.4, "inches": 25.4, "mil": 0.0254, "thou": 0.0254},
    **{"micron": 1e-3, "microns": 1e-3},
    **{
        f"{prefix}{metre}": mm
        for prefix, mm in {"nano": 1e-6, "micro": 1e-3, "milli": 1.0, "centi": 10.0, "": 1e3}.items()
        for metre in ("meter", "metre", "meters", "metres")
    },
}
# units of length for settings, in words
UNITS = {"um": "micrometres", "mm": "millimetres", "m": "metres", "in": "inches", "nm": "nanometres"}
# seconds per unit of time
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86_400.0}


def factors_to_mm(raw: RawMap, pitch: float, settings: MapSettings) -> tuple[float, float]:
    """Factors that convert heights and sample distances to millimetres. Raises DataError: the numbers fit no part; the
    hint names a unit in which they do.

    `pitch` is the smaller distance of samples, in the file's numbers; in millimetres if the settings give it. The unit
    of the settings replaces the file's, except for heights or distances that it would make absurd.
    """
    shape = _Shape(raw, pitch)
    z_mm, xy_mm = raw.z_mm or 1.0, 1.0 if settings.pitch_mm is not None else raw.xy_mm or 1.0

    def factors(unit: str) -> dict[str, tuple[float, float]]:
        mm = MM[unit]
        if settings.pitch_mm is not None:
            return {"heights": (mm, 1.0)}
        return {"numbers": (mm, mm)} | (
            {} if raw.one_unit else {"heights": (mm, xy_mm), "distances": (z_mm, mm)}
        )

    if settings.unit is not None:
        tries = list(factors(settings.unit).values())
        fitting = [(z_mm, xy_mm) for z_mm, xy_mm in tries if not shape.absurdity(z_mm, xy_mm)]
        return min(fitting, key=lambda pair: shape.unusual(pair[0]), default=tries[0])
    absurd = shape.absurdity(z_mm, xy_mm)
    if not absurd:
        return z_mm, xy_mm
    choices = [
        (unit == "in" or (unit == "nm" and raw.z_mm is not None), shape.unusual(z), what, unit)
        for unit in UNITS
        # no format that states a unit confuses it with the nanometre, except in a map of absurd size
        if unit != "nm" or raw.z_mm is None or shape.odd_size(xy_mm)
        for what, (z, xy) in factors(unit).items()
        if not shape.absurdity(z, xy)
        # a table may state the unit of its distances alone
        if raw.xy_mm is None or raw.z_mm is not None or what == "heights"
    ]
    problem = _refusal(
        raw,
        shape,
        absurd,
        (z_mm, xy_mm),
        min(choices, key=lambda choice: choice[:2])[2:] if choices else None,
    )
    if problem is None:
        return z_mm, xy_mm  # flat, noisy or askew
    raise problem


def _refusal(
    raw: RawMap, shape: _Shape, absurd: str, factors: tuple[float, float], likeliest: tuple[str, str] | None
) -> DataError | None:
    states = f" (the file states {raw.unit})" if raw.unit else ""
    if shape.is_small(factors[1]) and (raw.unit or likeliest is None):
        states = states if raw.xy_mm == MM.get(raw.unit) else ""
        what = f"is too small for characters: {absurd}{states}"
        hint = "" if raw.unit else ", or give the distance of its samples with --pitch-mm"
        return DataError(what, f"measure the whole serial{hint}")
    if _LEAST_TILT_DEG < (tilt_deg := shape.tilt_deg(*factors)) < _MOST_TILT_DEG:
        return DataError(
            f"{shape.span(*factors)}; it is tilted by {tilt_deg:.0f} degrees",
            "level the part, and measure it again",
        )
    if raw.one_unit and shape.is_upright(*factors):
        return DataError(f"{absurd}; its marks do not face z", "turn it until its marked side faces z")
    if not shape.odd_size(factors[1]) and likeliest is None:
        return None
    if raw.unit:
        return DataError(f"{absurd}{states}", "if that is wrong, give --unit or --pitch-mm")
    if likeliest is not None:
        numbers, unit = likeliest
        return DataError(absurd, f"are the {numbers} {UNITS[unit]}? then give --unit {unit}")
    return DataError(
        f"{absurd}; these numbers fit a part in no unit",
        "give the distance of its samples with --pitch-mm, or confirm the unit with --unit",
    )


class _Shape:
    """Measures of a map in the file's numbers: ranges of heights without outliers, `depth` without tilt and dome."""

    def __init__(self, raw: RawMap, pitch: float) -> None:
        self.raw, self.pitch = raw, pitch
        self.relief = self.depth = self.rise = self.slope = 0.0
        z, lag = raw.z, max(1, round(min(raw.z.shape) / 50))
        step = max(1, int(np.sqrt(z.size / _SUBSAMPLE)))
        few = np.asarray(z[::step, ::step], dtype=np.float64)
        known = np.isfinite(few)
        if known.sum() < 8:
            return
        down = z[lag::step, ::step] - z[:-lag:step, ::step]
        right = z[::step, lag::step] - z[::step, :-lag:step]
        rises = np.abs(np.concatenate([down.ravel(), right.ravel()]))
        rises = rises[np.isfinite(rises)]
        y, x = (axis[known] for axis in np.indices(few.shape) / max(few.shape))
        heights = few[known] - np.median(few[known])
        form = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
        marks = heights - form @ np.linalg.lstsq(form, heights, rcond=None)[0]
        self.relief = float(np.ptp(np.percentile(heights, (0.2, 99.8))))
        self.depth = float(np.ptp(np.percentile(marks, (1, 99))))
        # mean steepness over a fiftieth of the shorter side, per sample
        self.rise = float(rises.mean()) / lag if rises.size else 0.0
        # its slope is 0 where it is not most of the heights
        plane = np.linalg.lstsq(form[:, :3], heights, rcond=None)[0]
        if np.ptp(np.percentile(heights - form[:, :3] @ plane, (1, 99))) < _PLANE_SHARE * self.relief:
            self.slope = float(np.hypot(plane[1], plane[2])) / max(few.shape) / step

    def tilt_deg(self, z_mm: float, xy_mm: float) -> float:
        return float(np.degrees(np.arctan(self.slope * z_mm / (self.pitch * xy_mm))))

    def is_upright(self, z_mm: float, xy_mm: float) -> bool:
        """Whether it stands on the edge of a plate, rather than being tall with marks on its end."""
        return bool(self.relief * z_mm > _UPRIGHT * min(self.raw.z.shape) * self.pitch * xy_mm)

    def is_small(self, xy_mm: float) -> bool:
        least = LEAST_PLATE_MM if self.raw.z_mm is None else LEAST_STATED_MM
        return bool(min(self.raw.z.shape) * self.pitch * xy_mm < least)

    def unusual(self, z_mm: float) -> float:
        """Distance of the height range from that of a stamped plate, in powers of ten."""
        return abs(float(np.log10(max(self.relief * z_mm, 1e-9) / USUAL_RELIEF_MM)))

    def absurdity(self, z_mm: float, xy_mm: float) -> str:
        if odd := self.odd_size(xy_mm):
            return odd
        pitch, relief, depth = self.pitch * xy_mm, self.relief * z_mm, self.depth * z_mm
        shorter, longer = (n * pitch for n in sorted(self.raw.z.shape))
        size = self._size(pitch)
        least = LEAST_RELIEF_MM if self.raw.z_mm is None else LEAST_RELIEF_SHARE * shorter
        if relief > min(MOST_RELIEF_MM, MOST_RELIEF_SHARE * longer) or 0.0 < relief < least:
            return self.span(z_mm, xy_mm)
        if self.raw.one_unit:  # a mesh may show the part's base, too
            return ""
        if depth > MOST_DEPTH_MM:
            return f"marks are {_length(depth)} deep on a map of {size}"
        if self.rise * z_mm / pitch > MOST_STEEPNESS:
            return f"marks {_length(depth)} deep make a map of {size} steeper than 45 degrees throughout"
        return ""

    def odd_size(self, xy_mm: float) -> str:
        pitch = self.pitch * xy_mm
        longer = max(self.raw.z.shape) * pitch
        if pitch > MOST_PITCH_MM:
            return f"its samples lie {_length(pitch)} apart, on a map of {self._size(pitch)}"
        if longer > MOST_PLATE_MM or self.is_small(xy_mm):
            return f"the map measures {self._size(pitch)}"
        return ""

    def span(self, z_mm: float, xy_mm: float) -> str:
        return f"heights span {_length(self.relief * z_mm)} on a map of {self._size(self.pitch * xy_mm)}"

    def _size(self, pitch_mm: float) -> str:
        rows, cols = self.raw.z.shape
        return f"{_length(cols * pitch_mm)} x {_length(rows * pitch_mm)}"


def _length(mm: float) -> str:
    if mm >= 1e3:
        return f"{mm / 1e3:.3g} m" if mm < 1e6 else f"{mm / 1e3:,.0f} m"
    return f"{mm:.3g} mm" if mm >= 0.1 or mm == 0.0 else f"{mm * 1e3:.3g} um"


# greatest relative difference of two pitches that count as equal: 1 in 1000 shears no character
SAME_PITCH = 1e-3
MUCH_FINER = 4.0
# mm from the median height: anything farther off is an instrument's bad point
MAX_HEIGHT_MM = 1000.0
# mm: a larger median height is subtracted; up to here float32 resolves a nanometre
MOST_OFFSET_MM = 10.0
# mm: even with a unit given, no readable character has samples so far apart
MAX_PITCH_MM = 10.0


def part_map(raw: RawMap, settings: MapSettings) -> Surface:
    """The top of a part in mm, row 0 at the top, and the dirt on it, if stated. Raises MarksError: it is not usable."""
    if raw.z.ndim != 2 or min(raw.z.shape) < 2:
        raise DataError(*PROFILE)
    check_size(*raw.z.shape)
    x_pitch, y_pitch = _pitches(raw, settings)
    z = without_bad_points(np.array(raw.z, dtype=np.float64))
    if not np.isfinite(z).any():
        raise DataError("has no finite height; every point is a dropout", "measure it again")
    raw, pitch = replace(raw, z=z), min(x_pitch, y_pitch)
    try:
        z_mm, xy_mm = factors_to_mm(raw, pitch, settings)
    except DataError:
        z = without_isolated_value(z.copy())
        if not _fits_better(replace(raw, z=z), raw, pitch, settings):
            raise
        z_mm, xy_mm = factors_to_mm(replace(raw, z=z), pitch, settings)
    z *= z_mm
    offset = float(np.median(z[np.isfinite(z)]))
    if abs(offset) > MOST_OFFSET_MM:
        z -= offset
    z[np.abs(z) > MAX_HEIGHT_MM] = np.nan
    soil = raw.soil
    if settings.rows == "bottom-first" or (settings.rows is None and raw.bottom_first):
        z, soil = z[::-1], soil and soil.mirrored
    for pitch in (x_pitch * xy_mm, y_pitch * xy_mm):
        if not (np.isfinite(pitch) and 0.0 < pitch <= MAX_PITCH_MM):
            what = f"has samples {pitch:.4g} mm apart"
            raise DataError(
                what, f"{_by_unit(settings)}give their distance in mm with --pitch-mm, at most 10"
            )
    z, pitch_mm = _on_square_grid(z, x_pitch * xy_mm, y_pitch * xy_mm)
    height_map = HeightMap(np.asarray(z, dtype=np.float32), pitch_mm)
    from recognition.surface import Surface  # slow, and files that cannot be used do not need it

    return Surface(height_map, soil, raw.rows_stated or settings.rows is not None)


def _by_unit(settings: MapSettings) -> str:
    return "" if settings.unit is None else f"check --unit {settings.unit}, or "


def _fits_better(varying: RawMap, raw: RawMap, pitch: float, settings: MapSettings) -> bool:
    """Whether the heights without the constant fit a part in the file's unit as well as all fit one in another unit."""
    if np.isfinite(varying.z).sum() == np.isfinite(raw.z).sum():
        return False
    shape, varying_shape = _Shape(raw, pitch), _Shape(varying, pitch)
    z_mm, xy_mm = raw.z_mm or 1.0, 1.0 if settings.pitch_mm is not None else raw.xy_mm or 1.0
    if varying_shape.absurdity(z_mm, xy_mm):
        return False
    in_other_unit = min(
        (shape.unusual(MM[unit]) for unit in UNITS if not shape.absurdity(MM[unit], xy_mm)),
        default=np.inf,
    )
    return varying_shape.unusual(z_mm) <= in_other_unit


def _pitches(raw: RawMap, settings: MapSettings) -> tuple[float, float]:
    if settings.pitch_mm is not None:
        return settings.pitch_mm, settings.pitch_mm
    if raw.x_pitch is None or raw.y_pitch is None:
        raise DataError(
            f"is a matrix of {raw.z.shape[0]} x {raw.z.shape[1]} heights without the distance of its samples",
            "give it with --pitch-mm 0.05 on the command line, or save .npz with z_mm and pitch_mm",
        )
    for pitch in (raw.x_pitch, raw.y_pitch):
        if not (np.isfinite(pitch) and pitch > 0.0):
            raise DataError(f"states {pitch:g} as the distance of its samples", "give it with --pitch-mm")
    return raw.x_pitch, raw.y_pitch


def _on_square_grid(z: NDArray[np.float64], x_mm: float, y_mm: float) -> tuple[NDArray[np.float64], float]:
    """Resample the coarser axis linearly to the finer pitch, or the finer axis if it is more than four times finer."""
    finer, coarser = sorted((x_mm, y_mm))
    if coarser / finer - 1.0 <= SAME_PITCH:
        return z, 0.5 * (finer + coarser)
    pitch = coarser if coarser / finer > MUCH_FINER else finer
    rows, cols = (_count(n, p, pitch) for n, p in zip(z.shape, (y_mm, x_mm), strict=True))
    check_size(rows, cols)
    z = _resample_rows(z, rows, pitch / y_mm)
    return _resample_rows(z.T, cols, pitch / x_mm).T, pitch


def _count(n: int, old_mm: float, new_mm: float) -> int:
    return max(2, int((n - 1) * old_mm / new_mm + 1e-9) + 1)


def _resample_rows(z: NDArray[np.float64], n_rows: int, step: float) -> NDArray[np.float64]:
    if n_rows == z.shape[0] and abs(step - 1.0) < 1e-12:
        return z
    place = np.minimum(np.arange(n_rows) * step, z.shape[0] - 1)
    low = np.minimum(place.astype(np.intp), z.shape[0] - 2)
    weight = (place - low)[:, None]
    # a row at an exact multiple does not use its neighbour, which may be a dropout
    between = (1.0 - weight) * z[low] + weight * z[low + 1]
    return np.asarray(np.where(weight == 0.0, z[low], np.where(weight == 1.0, z[low + 1], between)))
