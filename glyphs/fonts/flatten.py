"""Outlines of TrueType and OpenType fonts as polygons."""

from __future__ import annotations

from typing import Any

import numpy as np
from fontTools.pens.basePen import BasePen

from glyphs.fonts.glyph import FontError, Points

_Outline = tuple[tuple[Points, ...], float]
_MAX_STEPS = 64
MOST_COMPONENTS = 256
"""Most component glyphs of one glyph, counted over all levels."""


class _LimitedPen(BasePen):  # type: ignore[misc,unused-ignore]
    _components = 0

    def addComponent(self, *args: Any, **options: Any) -> None:
        self._components += 1
        if self._components > MOST_COMPONENTS:
            what = f"a glyph is made of more than {MOST_COMPONENTS} others"
            raise FontError(what, hint="the font is damaged or malicious, use another")
        super().addComponent(*args, **options)


class _PolygonPen(_LimitedPen):
    def __init__(self, glyph_set: Any, tolerance: float) -> None:
        super().__init__(glyph_set)
        self.tolerance = tolerance
        self.polygons: list[list[tuple[float, float]]] = []

    def _moveTo(self, pt: tuple[float, float]) -> None:
        self.polygons.append([pt])

    def _lineTo(self, pt: tuple[float, float]) -> None:
        self.polygons[-1].append(pt)

    def _curveToOne(
        self, pt1: tuple[float, float], pt2: tuple[float, float], pt3: tuple[float, float]
    ) -> None:
        p0, p1, p2, p3 = np.array([self._getCurrentPoint(), pt1, pt2, pt3], dtype=np.float64)
        bend = max(np.hypot(*(p0 - 2 * p1 + p2)), np.hypot(*(p1 - 2 * p2 + p3)))
        # A chord over 1/n of a cubic's parameter deviates from it by at most 6/8 of the bend over n squared.
        steps = int(np.clip(np.ceil(np.sqrt(0.75 * bend / self.tolerance)), 1, _MAX_STEPS))
        t = (np.arange(1, steps + 1) / steps)[:, None]
        curve = (1 - t) ** 3 * p0 + 3 * t * (1 - t) ** 2 * p1 + 3 * t**2 * (1 - t) * p2 + t**3 * p3
        self.polygons[-1].extend((float(x), float(y)) for x, y in curve)


def read_outlines(file: Any, characters: str, *, flatness: float) -> tuple[str, dict[str, _Outline]]:
    """Polygons and advances of a `TTFont`'s characters, scaled to a cap height of 1.

    Returns the full name (may be empty) and {character: (polygons (n, 2) each, advance)}. `flatness` is the greatest
    distance of a chord from its curve, cap heights. Raises FontError for a font without characters or cap height.
    """
    cmap = file.getBestCmap()
    if not cmap:
        raise FontError("the font has no Unicode character map", hint="use another font")
    glyph_set = file.getGlyphSet()
    cap = _cap_height(file, cmap, glyph_set)
    out: dict[str, _Outline] = {}
    for char in characters:
        name = cmap.get(ord(char))
        if name is None:
            continue
        pen = _PolygonPen(glyph_set, flatness * cap)
        glyph_set[name].draw(pen)
        polygons = tuple(
            q for p in pen.polygons if len(q := _distinct(np.array(p, dtype=np.float64) / cap)) >= 3
        )
        out[char] = (polygons, float(glyph_set[name].width) / cap)
    face = file["name"].getDebugName(4) if "name" in file else None
    return str(face or ""), out


def _distinct(points: Points) -> Points:
    keep = np.hypot(*(points - np.roll(points, 1, axis=0)).T) > 1e-7
    return np.asarray(points[keep], dtype=np.float64)


def _cap_height(file: Any, cmap: dict[int, str], glyph_set: Any) -> float:
    from fontTools.pens.boundsPen import BoundsPen

    class _BoundsPen(_LimitedPen, BoundsPen):  # type: ignore[misc,unused-ignore]
        pass

    if ord("H") in cmap:
        pen = _BoundsPen(glyph_set)
        glyph_set[cmap[ord("H")]].draw(pen)
        if pen.bounds is not None and pen.bounds[3] > 0:
            return float(pen.bounds[3])
    if "OS/2" in file and getattr(file["OS/2"], "sCapHeight", 0) > 0:
        return float(file["OS/2"].sCapHeight)
    if "hhea" in file and file["hhea"].ascent > 0:
        return float(file["hhea"].ascent)
    raise FontError("the font gives no cap height (no H, OS/2 or hhea table)", hint="use another font")
