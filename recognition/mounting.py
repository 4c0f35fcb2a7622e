"""A height map as a stage would mount it: level, and with a first idea of how tall its characters are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import HeightMap
from recognition.localise import MIN_RELIEF_SHARE, activity_of, bands, line_rotation_deg

MIN_HEIGHT_SHARE = 0.04
"""Of the map's smaller side: characters lower than this are not looked for unless their height is given."""
WORK_ROWS = 240
"""Rows at which the first look is taken."""


@dataclass(frozen=True)
class FirstLook:
    """What a height map shows before it is touched.

    Attributes:
        heights_mm: character heights worth trying, most promising first; empty when there is nothing to read.
        rotation_deg: of the line.
    """

    heights_mm: tuple[float, ...]
    rotation_deg: float


def level(height_map: HeightMap, *, degree: int = 2) -> HeightMap:
    """Take off tilt and slight dome: a robust polynomial through the land; dropouts stay NaN.

    Iteratively reweighted least squares with Tukey's biweight at three robust standard deviations, on a thinned
    grid. This mounts the part; it is no edge filter.
    """
    z = height_map.z_mm
    rows, cols = z.shape
    step = max(1, int(np.sqrt(z.size / 40_000)))
    thin = z[::step, ::step].astype(np.float64)
    v, u = np.meshgrid(
        np.linspace(-1.0, 1.0, rows)[::step], np.linspace(-1.0, 1.0, cols)[::step], indexing="ij"
    )
    known = np.isfinite(thin)
    design, target = _terms(u[known], v[known], degree), thin[known]
    weight: NDArray[np.floating[Any]] = np.ones(target.size)
    coefficients = np.zeros(design.shape[1])
    for _ in range(12):
        weighted = design * weight[:, None]
        normal = weighted.T @ design + 1e-10 * target.size * np.eye(design.shape[1])
        coefficients = np.asarray(np.linalg.solve(normal, weighted.T @ target))
        residual = target - design @ coefficients
        spread = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
        if spread <= 0.0:
            break
        weight = np.clip(1.0 - ((residual - np.median(residual)) / (3.0 * spread)) ** 2, 0.0, None) ** 2
    row_terms = np.linspace(-1.0, 1.0, rows)
    col_terms = np.linspace(-1.0, 1.0, cols)
    form = np.zeros((rows, cols), dtype=np.float32)
    for c, (i, j) in zip(coefficients, _powers(degree), strict=True):
        form += np.float32(c) * np.outer(row_terms**j, col_terms**i).astype(np.float32)
    return HeightMap(z - form, height_map.pitch_mm)


def _powers(degree: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]


def _terms(u: NDArray[np.float64], v: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    return np.stack([u**i * v**j for i, j in _powers(degree)], axis=-1)


def relief_mm(height_map: HeightMap) -> float:
    """Height range that all but the outer 0.2 percents of a levelled map span, mm."""
    finite = height_map.z_mm[np.isfinite(height_map.z_mm)]
    if finite.size > 400_000:
        finite = finite[:: finite.size // 200_000]
    low, high = np.percentile(finite, [0.2, 99.8])
    return float(high - low)


def first_look(levelled: HeightMap) -> FirstLook:
    """Rotation and heights worth trying, from the slopes of a levelled map."""
    from scipy import ndimage

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
    z = ndimage.gaussian_filter(z, 0.7)
    gv, gu = np.gradient(z, pitch)
    activity = activity_of(np.stack([gu, gv]).astype(np.float32))
    rotation = line_rotation_deg(activity)
    if rotation:
        activity = ndimage.rotate(activity, rotation, reshape=True, order=1)
    found = bands(activity, pitch_mm=pitch)
    heights = [b.height_mm for b in found if b.height_mm > MIN_HEIGHT_SHARE * smaller]
    return FirstLook(tuple(h for h in heights if deepest > MIN_RELIEF_SHARE * h), rotation)
