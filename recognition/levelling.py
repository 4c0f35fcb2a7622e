"""A height map as a stage would mount it: level, and with a first idea of how tall its characters are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap
from recognition.levelling_fit import (
    BRACKET,
    Terms,
    median_and_quantile,
    median_near,
    steepness_squared,
    tukey,
)
from recognition.localise import MIN_RELIEF_SHARE, bands, line_rotation_deg, runs_down

MIN_HEIGHT_SHARE = 0.04
"""Of the map's smaller side: characters lower than this are not looked for unless their height is given."""
WORK_ROWS = 240
"""Rows at which the first look is taken."""
_SMOOTHING_PIXELS = 0.7


@dataclass(frozen=True)
class FirstLook:
    """What a height map shows before it is touched.

    Attributes:
        heights_mm: character heights worth trying, most promising first; empty when there is nothing to read.
        rotation_deg: of the line.
        runs_down: the line runs up or down: the plate lies turned by a quarter.
    """

    heights_mm: tuple[float, ...]
    rotation_deg: float
    runs_down: bool = False


def level(height_map: HeightMap, *, degree: int = 2) -> HeightMap:
    """Take off tilt and slight dome: a robust polynomial through the land; dropouts stay NaN.

    Iteratively reweighted least squares with Tukey's biweight at three robust standard deviations, on a thinned
    grid. This mounts the part; it is no edge filter.
    """
    z = height_map.z_mm
    rows, cols = z.shape
    step = max(1, int(np.sqrt(z.size / 40_000)))
    thin = np.ascontiguousarray(z[::step, ::step], dtype=np.float64)
    row_terms, col_terms = np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, cols)
    terms = Terms(col_terms[::step], row_terms[::step], degree)
    known = np.isfinite(thin)
    all_known = bool(known.all())
    weight = known.astype(np.float64)
    weighted = np.where(known, thin, 0.0)
    middle = spread = 0.0
    for _ in range(12):
        normal = terms.normal(weight)
        normal[np.diag_indices_from(normal)] += 1e-10 * np.count_nonzero(known)
        coefficients = np.asarray(np.linalg.solve(normal, terms.right(weighted)))
        over = thin - terms.surface(coefficients)
        residual = over.ravel() if all_known else over[known]
        middle = median_near(residual, middle, BRACKET * spread)
        spread = 1.4826 * median_near(residual, spread / 1.4826, BRACKET * spread, about=middle)
        if spread <= 0.0:
            break
        weight, weighted = tukey(thin, over, middle, 3.0 * spread)
    out = z.copy()
    out -= terms.form(coefficients, col_terms, row_terms)
    out.flags.writeable = False  # so that it is not copied
    return HeightMap(out, height_map.pitch_mm)


def relief_mm(height_map: HeightMap) -> float:
    """Height range that all but the outer 0.2 percents of a levelled map span, mm."""
    finite = height_map.z_mm[np.isfinite(height_map.z_mm)]
    if finite.size > 400_000:
        finite = finite[:: finite.size // 200_000]
    low, high = np.percentile(finite, [0.2, 99.8])
    return float(high - low)


def _activity(z: NDArray[np.float32], pitch_mm: float) -> NDArray[np.float64]:
    """`localise.activity_of` both slopes of a map, without laying them out."""
    activity = steepness_squared(z, pitch_mm)
    floor, top = median_and_quantile(activity, 0.97)
    activity -= floor
    return np.asarray(np.clip(activity, 0.0, max(top - floor, 1e-300), out=activity))


def first_look(levelled: HeightMap) -> FirstLook:
    """Rotation and heights worth trying, from the slopes of a levelled map."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    rows = levelled.shape[0]
    smaller = min(levelled.size_mm)
    deepest = relief_mm(levelled)
    if deepest < MIN_RELIEF_SHARE * MIN_HEIGHT_SHARE * smaller:
        return FirstLook((), 0.0)
    step = max(1, rows // WORK_ROWS)
    z = np.where(np.isfinite(levelled.z_mm), levelled.z_mm, 0.0)
    if step > 1:
        z = ndimage.uniform_filter(z, size=step)[step // 2 :: step, step // 2 :: step]
    pitch = levelled.pitch_mm * step
    smooth = cv2.GaussianBlur(z, (7, 7), _SMOOTHING_PIXELS, borderType=cv2.BORDER_REFLECT)
    activity = _activity(np.asarray(smooth, dtype=np.float32), pitch)
    down = runs_down(activity)
    rotation = line_rotation_deg(activity)
    if rotation:
        activity = ndimage.rotate(activity, rotation, reshape=True, order=1)
    found = bands(activity, pitch_mm=pitch)
    heights = [b.height_mm for b in found if b.height_mm > MIN_HEIGHT_SHARE * smaller]
    return FirstLook(tuple(h for h in heights if deepest > MIN_RELIEF_SHARE * h), rotation, down)
