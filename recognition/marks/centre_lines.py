"""Centre lines of strokes, where they are deepest; of an outline, its skeleton without branches into corners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph, Points, signed_distance
from glyphs.stamping.die import die_glyph
from glyphs.stamping.faces import Face, default_die
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM


@dataclass(frozen=True, eq=False)
class CentreLine:
    """Points along the middle of a character's strokes, about its reference point."""

    # (n, 2) offsets (u to the right, v down) from the reference point, the middle of the ink's width at half
    # the height; character heights
    points: NDArray[np.float64]
    normals: NDArray[np.float64]  # (n, 2) unit vectors across the stroke
    half_width: float


@lru_cache(maxsize=1024)
def centre_line(
    font: Font,
    char: str,
    *,
    face: Face = Face.FLAT,
    step_heights: float = 0.025,
    ridge_pitch_heights: float = 0.02,
    # minimum half width of an outline's limbs, as a share of the median: thinner ones are corners, and serifs too
    # thin for a tip
    ridge_share: float = 0.85,
) -> CentreLine:
    """The centre line of a font's character; without points if it has no ink. Raises FontError or StampError."""
    die = default_die(CANONICAL_HEIGHT_MM, font=font, face=face)
    shape = die_glyph(font.glyph(char), die, height_mm=CANONICAL_HEIGHT_MM)
    if not shape.inked:
        return CentreLine(np.empty((0, 2)), np.empty((0, 2)), 0.0)
    if shape.contours:
        points, normals, half = _ridge(shape, pitch=ridge_pitch_heights, share=ridge_share)
    else:
        # half a stroke's width is left out at both ends: dies are rounded there, and a small error of pose or size
        # would put the ends beside the groove
        half = 0.5 * shape.stroke
        parts = [_points_along(stroke, trim=half, step=step_heights) for stroke in shape.strokes]
        points, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    x0, _, x1, _ = shape.ink_box
    offsets = (points - (0.5 * (x0 + x1), 0.5)) * (1.0, -1.0)
    return CentreLine(offsets, normals * (1.0, -1.0), half)


def _points_along(stroke: Points, *, trim: float, step: float) -> tuple[Points, Points]:
    run = np.diff(stroke, axis=0)
    length = np.hypot(run[:, 0], run[:, 1])
    run, length = run[length > 0.0], length[length > 0.0]
    if not length.size:
        return stroke[:1], np.array([[1.0, 0.0]])
    corner = np.concatenate([stroke[:1], stroke[0] + np.cumsum(run, axis=0)])
    distance = np.append(0.0, np.cumsum(length))
    closed = bool(np.hypot(*(stroke[-1] - stroke[0])) < 1e-6)
    cut = 0.0 if closed else min(trim, 0.5 * float(distance[-1]))
    count = max(1, round((float(distance[-1]) - 2.0 * cut) / step) + 1)
    where = np.linspace(cut, float(distance[-1]) - cut, count)
    piece = np.clip(np.searchsorted(distance, where, side="right") - 1, 0, length.size - 1)
    points = np.column_stack(
        [np.interp(where, distance, corner[:, 0]), np.interp(where, distance, corner[:, 1])]
    )
    ahead = run[piece] / length[piece, None]
    return points, np.column_stack([-ahead[:, 1], ahead[:, 0]])


def _ridge(shape: Glyph, *, pitch: float, share: float) -> tuple[Points, Points, float]:
    from skimage.morphology import skeletonize

    x0, y0, x1, y1 = shape.ink_box
    x = np.arange(x0, x1 + pitch, pitch)
    y = np.arange(y0, y1 + pitch, pitch)
    inside = -signed_distance(shape, x[None, :], y[:, None], stroke=0.0).astype(np.float64)
    dy, dx = np.gradient(inside, pitch)
    dxy, dxx = np.gradient(dx, pitch)
    dyy = np.gradient(dy, pitch, axis=0)
    ridge = np.asarray(skeletonize(inside > 0.0))  # type: ignore[no-untyped-call,unused-ignore]
    half = float(np.median(inside[ridge]))
    ridge &= inside >= share * half
    row, col = np.nonzero(ridge)
    # the distance is most curved across the limb: the eigenvector of its Hessian with the lesser eigenvalue
    along = 0.5 * np.arctan2(2.0 * dxy[ridge], dxx[ridge] - dyy[ridge])
    normals = np.column_stack([-np.sin(along), np.cos(along)])
    return np.column_stack([x[col], y[row]]), normals, half
