"""The first pass over an unknown part: coarse, and always at the same scale.

    part --whiskers for 4 mm characters, every 0.15 mm, there and back--> view --find lines--> character heights
                                                                                                     |
                                                     whisker, preload and plan of the scan that is read

On a bench or a height map, nothing else shows the height of the characters. If it is known, there is no first pass.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from recognition.find.find import search_of, within_area
from recognition.find.request import LineRequest
from recognition.see.view import felt_view, relief_of
from recognition.see.virtual_array import USUAL_ARRAY, VirtualArray
from recognition.see.virtual_bench import VirtualBench
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import Scan
from whisker_array.whisker.array import default_plan

Feel = Callable[[HeightMap, float], Scan]
"""A function that scans a level surface for characters of a height, mm."""

FIRST_HEIGHT_MM = 4.0
"""Character height for which the whiskers are made; they find characters of `LEAST_HEIGHT_MM` to 25 mm."""
LEAST_HEIGHT_MM = 0.8


class NothingFeltError(MapError):
    """A scan in which nothing was felt."""


def virtual_feel(
    array: VirtualArray = USUAL_ARRAY, *, soil: Soil | None = None, part_id: str = "", **plan: Any
) -> Feel:
    """Make a function that scans with the virtual array and the default plan, or `plan`, for a character height."""

    def feel(surface: HeightMap, height_mm: float) -> Scan:
        bench = VirtualBench(surface, height_mm, array, soil, part_id=part_id)
        raster = default_plan(
            (0.0, 0.0, *surface.size_mm), character_height_mm=height_mm, speed_mm_s=array.speed_mm_s, **plan
        )
        return bench.scan(raster)

    return feel


def felt_heights_mm(
    request: LineRequest,
    surface: HeightMap,
    *,
    array: VirtualArray = USUAL_ARRAY,
    soil: Soil | None = None,
    feel: Feel | None = None,
    most: int = 2,
    first_lines: int = 26,
) -> list[float]:
    """Character heights, mm, by a first pass, most promising first. Raises MapError, NothingFeltError."""
    if request.height_mm:
        return [request.height_mm]
    if max(surface.size_mm) < LEAST_HEIGHT_MM:
        width, height = surface.size_mm
        raise MapError(
            f"the map is {width:.2g} x {height:.2g} mm: too small for characters",
            hint="measure the whole serial; if the map is larger, correct its unit",
        )
    feel = feel or virtual_feel(
        array,
        soil=soil,
        directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_X),
        lines_per_height=first_lines,
    )
    scan = feel(surface, FIRST_HEIGHT_MM)
    try:
        edges = edge_map(scan)
    except MapError as error:
        raise NothingFeltError(error.what, hint=error.hint) from error
    (view,), request = within_area([felt_view(edges, relief_of(scan, edges), scan.touch)], request)
    return of_other_scales(search_of(view, request).heights_mm())[:most]


def of_other_scales(heights_mm: Iterable[float], *, ratio: float = 1.2) -> list[float]:
    """Keep the heights that differ from all earlier ones by more than this ratio: each is worth its own scan."""
    scales: list[float] = []
    for height in heights_mm:
        if all(abs(math.log(height / other)) > math.log(ratio) for other in scales):
            scales.append(height)
    return scales
