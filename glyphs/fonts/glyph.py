"""Glyphs and fonts: strokes or contours in the glyph frame, and the signed distance from the ink.

Glyph frame: x right from the left bearing (0 .. advance), y *up* from the baseline, unit = cap height.

In a stroke font the ink of an H, not its centre line, spans y = 0..1. The centre lines are inset for this: they run
from stroke/2 to 1 - stroke/2. `with_stroke` refits them to another stroke width, so a glyph stamped at `height_mm` is
`height_mm` tall for any stroke width of the die.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.errors import MarksError
from glyphs.ranges import Range, ShareBelowOne, Validated, require_range
from glyphs.surface.display import OneLine

Points = NDArray[np.float64]

MOST_CAP_HEIGHTS = 100.0
"""Largest coordinate and advance, cap heights: in any font a character is about as wide as it is tall."""
RELIEF_PIXELS = 40
"""Pixels per cap height in a relief learned by touch."""


class FontError(MarksError):
    """A font or glyph that cannot be used."""


def _point_arrays(name: str, char: str, arrays: tuple[Points, ...], least: int) -> tuple[Points, ...]:
    out = []
    for points in arrays:
        array = np.array(points, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 2 or array.shape[0] < least:
            raise FontError(
                f"{name} of {char!r} has shape {array.shape}",
                hint=f"it must be (n, 2) with n of at least {least}",
            )
        if not np.isfinite(array).all():
            raise FontError(f"{name} of {char!r} has coordinates that are not finite")
        if np.abs(array).max() > MOST_CAP_HEIGHTS:
            raise FontError(f"{name} of {char!r} extends beyond {MOST_CAP_HEIGHTS:.0f} cap heights")
        array.flags.writeable = False
        out.append(array)
    return tuple(out)


def _checked_relief(char: str, relief: NDArray[np.float32]) -> NDArray[np.float32]:
    array = np.array(relief, dtype=np.float32)
    if array.ndim != 2 or array.shape[0] % 2 == 0 or array.shape[1] % 2 == 0:
        raise FontError(
            f"the relief of {char!r} has shape {array.shape}", hint="rows and columns must be odd"
        )
    if not np.isfinite(array).all():
        raise FontError(f"the relief of {char!r} has heights that are not finite")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Glyph(OneLine, Validated, error=FontError):
    """The shape of one character in the glyph frame. Raises FontError.

    Attributes:
        strokes: open polylines (n, 2), n >= 1 (one point is a dot); empty for an outline glyph.
        contours: closed polygons (n, 2), n >= 3, non-zero winding; the first point is not repeated. Empty for a stroke
            glyph. A space has neither strokes nor contours.
        advance: distance to the origin of the next character, cap heights.
        stroke: stroke width for which the centre lines were inset, cap heights; 0 for contours.
        relief: heights of a character learned by touch, (rows, cols) float32, in cap heights, negative in the mark;
            None for any other glyph. There are RELIEF_PIXELS pixels for each cap height; rows and cols are odd, and
            row 0 is the top. The middle pixel lies at the middle of the ink across and at half the cap height.
            Templates are made from the relief; the contours only draw its outline.
        guessed: whether a learned font took this character from a similar font.
    """

    char: str
    strokes: tuple[Points, ...] = ()
    contours: tuple[Points, ...] = ()
    advance: Annotated[float, Range(0.0, MOST_CAP_HEIGHTS)] = 0.0
    stroke: ShareBelowOne = 0.0
    relief: NDArray[np.float32] | None = None
    guessed: bool = False

    def __post_init__(self) -> None:
        if len(self.char) != 1:
            raise FontError(f"a glyph stands for one character, not for {self.char!r}")
        if self.strokes and self.contours:
            raise FontError(f"glyph {self.char!r} has strokes and contours", hint="give one of them")
        object.__setattr__(self, "strokes", _point_arrays("a stroke", self.char, tuple(self.strokes), 1))
        object.__setattr__(self, "contours", _point_arrays("a contour", self.char, tuple(self.contours), 3))
        super().__post_init__()
        if self.relief is not None:
            object.__setattr__(self, "relief", _checked_relief(self.char, self.relief))

    @property
    def inked(self) -> bool:
        return bool(self.strokes or self.contours)

    @cached_property
    def ink_box(self) -> tuple[float, float, float, float]:
        """Bounding box (x0, y0, x1, y1) of the ink, nominal stroke included, or of the empty cell, cap heights."""
        if not self.inked:
            return (0.0, 0.0, self.advance, 1.0)
        points = np.concatenate(self.strokes + self.contours)
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        half = self.stroke / 2
        return (float(x0 - half), float(y0 - half), float(x1 + half), float(y1 + half))

    @cached_property
    def segments(self) -> Points:
        """(m, 4) directed segments x0, y0, x1, y1 of the strokes or contours; a dot is a segment of zero length."""
        parts = [np.hstack([c, np.roll(c, -1, axis=0)]) for c in self.contours]
        for s in self.strokes:
            parts.append(np.hstack([s[:-1], s[1:]]) if len(s) > 1 else np.hstack([s, s]))
        return np.ascontiguousarray(np.concatenate(parts)) if parts else np.empty((0, 4))

    @cached_property
    def boundary(self) -> Points:
        """(m, 4) segments that bound the ink: `segments` without the pieces inside overlapping contours."""
        return _ink_boundary(self.segments) if self.contours else self.segments


@dataclass(frozen=True, eq=False, repr=False)
class Font(OneLine, Validated, error=FontError):
    """A set of glyphs; ratio of nominal stroke to cap height, 0.0 for outline fonts. Raises FontError."""

    name: str
    glyphs: Mapping[str, Glyph]
    stroke_ratio: ShareBelowOne
    source: str

    def __post_init__(self) -> None:
        if not self.name:
            raise FontError("a font needs a name")
        if not self.glyphs:
            raise FontError(f"font {self.name!r} has no glyphs")
        wrong = [key for key, glyph in self.glyphs.items() if key != glyph.char]
        if wrong:
            raise FontError(
                f"font {self.name!r} has keys that differ from the characters of their glyphs: {wrong}"
            )
        super().__post_init__()
        object.__setattr__(self, "glyphs", MappingProxyType(dict(self.glyphs)))

    @cached_property
    def learned(self) -> bool:
        return any(glyph.relief is not None for glyph in self.glyphs.values())

    def glyph(self, char: str) -> Glyph:
        """Return the glyph of a character. Raises FontError, which lists the characters of the font."""
        try:
            return self.glyphs[char]
        except KeyError:
            have = "".join(sorted(c for c in self.glyphs if c != " "))
            raise FontError(f"font {self.name!r} has no character {char!r}", hint=f"it has {have}") from None


def with_stroke(glyph: Glyph, stroke: float) -> Glyph:
    """Refit a stroke glyph's centre lines to another stroke, cap heights; its height stays. Raises FontError."""
    if glyph.contours or stroke == glyph.stroke:
        return glyph
    narrow = Range(0.0, math.nextafter(1.0, 0.0), "use a narrower stroke or larger type")
    require_range(FontError, narrow, stroke=stroke)
    scale = (1.0 - stroke) / (1.0 - glyph.stroke)

    def refit(values: Points) -> Points:
        return (values - glyph.stroke / 2) * scale + stroke / 2

    return replace(
        glyph,
        strokes=tuple(refit(s) for s in glyph.strokes),
        advance=max(0.0, (glyph.advance - glyph.stroke) * scale + stroke),
        stroke=stroke,
    )


def transform_glyph(glyph: Glyph, *, x_scale: float = 1.0, shear: float = 0.0) -> Glyph:
    """Widen a glyph by `x_scale` and slant it by `shear` (x per y) about half the cap height; its stroke stays."""
    if x_scale == 1.0 and shear == 0.0:
        return glyph

    def move(p: Points) -> Points:
        return np.column_stack([p[:, 0] * x_scale + (p[:, 1] - 0.5) * shear, p[:, 1]])

    return replace(
        glyph,
        strokes=tuple(move(s) for s in glyph.strokes),
        contours=tuple(move(c) for c in glyph.contours),
        advance=glyph.advance * x_scale,
        relief=None,
    )


def signed_distance(glyph: Glyph, x: ArrayLike, y: ArrayLike, *, stroke: float) -> NDArray[np.float32]:
    """Compute the distance from the edge of the ink, negative inside it.

    Args:
        stroke: width of the stroke, cap heights; ignored for contours.

    Returns:
        float32 of the broadcast shape, cap heights. It is exact outside and inside contours and outside strokes.
        Inside a stroke it is the distance to the centre line minus half the stroke, so its minimum is -stroke/2. For a
        glyph without ink it is +inf everywhere.
    """
    from glyphs.fonts.distance import segment_distance, winding_number

    xs, ys = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    if not glyph.inked:
        return np.full(xs.shape, np.inf, dtype=np.float32)
    columns = xs.shape[-1] if xs.ndim else 1
    grid_x, grid_y = (np.ascontiguousarray(axis).reshape(-1, columns) for axis in (xs, ys))
    distance = segment_distance(grid_x, grid_y, glyph.boundary)
    if glyph.contours:
        distance = np.where(winding_number(grid_x, grid_y, glyph.segments) != 0, -distance, distance)
    else:
        distance = distance - stroke / 2
    return np.asarray(distance, dtype=np.float32).reshape(xs.shape)


def _ink_boundary(segments: Points) -> Points:
    p, d = segments[:, :2], segments[:, 2:] - segments[:, :2]
    cross = d[:, None, 0] * d[None, :, 1] - d[:, None, 1] * d[None, :, 0]
    gap = p[None, :, :] - p[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (gap[..., 0] * d[None, :, 1] - gap[..., 1] * d[None, :, 0]) / cross
        u = (gap[..., 0] * d[:, None, 1] - gap[..., 1] * d[:, None, 0]) / cross
    tiny = 1e-9
    crossing = (t > tiny) & (t < 1 - tiny) & (u > -tiny) & (u < 1 + tiny)
    pieces = []
    for k in range(len(segments)):
        cuts = np.concatenate([[0.0], np.sort(t[k][crossing[k]]), [1.0]])
        ends = p[k] + cuts[:, None] * d[k]
        pieces.append(np.hstack([ends[:-1], ends[1:]]))
    cut = np.concatenate(pieces)
    run = cut[:, 2:] - cut[:, :2]
    length = np.hypot(run[:, 0], run[:, 1])
    cut, run, length = cut[length > tiny], run[length > tiny], length[length > tiny]
    middle = (cut[:, :2] + cut[:, 2:]) / 2
    side = np.column_stack([-run[:, 1], run[:, 0]]) / length[:, None] * 1e-6
    left = _winding(middle + side, segments) != 0
    right = _winding(middle - side, segments) != 0
    return np.ascontiguousarray(cut[left != right])


def _winding(points: Points, segments: Points) -> NDArray[np.int32]:
    from glyphs.fonts.distance import winding_number

    x, y = np.ascontiguousarray(points[:, :1]), np.ascontiguousarray(points[:, 1:])
    return np.asarray(winding_number(x, y, segments)[:, 0], dtype=np.int32)
