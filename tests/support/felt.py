"""Whole plates as the default plan feels them."""

from __future__ import annotations

from typing import Any

import numpy as np

from glyphs.surface.maps import HeightMap, TraceDirection
from recognition.views.view import HEIGHTS, KNOWN, LAYERS, View, ViewKind
from whisker_array.estimation.relief import Relief
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


def view_of(relief: Relief) -> View:
    """The view of a surface without edges."""
    layers = np.zeros((LAYERS, *relief.height_mm.shape), dtype=np.float32)
    layers[KNOWN] = np.isfinite(relief.height_mm)
    layers[HEIGHTS] = np.nan_to_num(relief.height_mm)
    return View(ViewKind.FELT, layers, relief.pitch_mm, relief.origin_mm)
