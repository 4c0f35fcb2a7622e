"""Whole plates as the default plan feels them."""

from __future__ import annotations

from typing import Any

from glyphs.surface.maps import HeightMap, TraceDirection
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.whisker.array import ALL_DIRECTIONS, default_plan
from whisker_array.whisker.touch import Touch, default_touch


def felt(
    surface: HeightMap,
    height_mm: float = 5.0,
    *,
    touch: Touch | None = None,
    directions: tuple[TraceDirection, ...] = ALL_DIRECTIONS,
    **more: Any,
) -> Scan:
    """A scan of all of it, for characters so high; `more` is for `trace_scan`."""
    plan = default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=height_mm, directions=directions)
    return trace_scan(surface, touch=touch or default_touch(height_mm), plan=plan, **more)
