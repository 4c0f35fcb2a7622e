"""The characters of a whole part whose text is known: felt as the reader feels it, then cut out."""

from __future__ import annotations

import numpy as np

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from recognition.belief.line_search import MOST_SCANS, LineSearch
from recognition.language.remainders import ALPHANUMERIC
from recognition.learning.exemplars import Cut, ExemplarError, cut_line
from recognition.views.first_pass import felt_heights_mm, virtual_feel
from recognition.views.levelling import level
from recognition.views.view import relief_of
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import Scan


def cut_scan(
    scan: Scan,
    text: str,
    *,
    height_mm: float | None = None,
) -> tuple[Cut, ...]:
    """The characters of a recorded scan; see `cut_line`.

    Raises:
        ExemplarError: as `cut_line`, or the scan gives no heights.
        MapError: a scan that makes no edge map.
    """
    edges = edge_map(scan)
    relief = relief_of(scan, edges)
    if relief is None:
        raise ExemplarError(
            "the scan gives no heights", hint="record it with the default whisker, all directions"
        )
    return cut_line(edges, relief, text, height_mm=height_mm)


def cut_height_map(
    height_map: HeightMap,
    text: str,
    *,
    soil: Soil | None = None,
    height_mm: float | None = None,
    good_score: float = 0.7,
) -> tuple[Cut, ...]:
    """The characters of a height map, scanned with the virtual array as for reading; see `cut_line`.

    Args:
        good_score: belief a character from which no other scale is tried.

    Raises:
        ExemplarError: as `cut_line`, or no characters to be seen.
        MapError: a map that cannot be scanned, a soil on another grid.
    """
    levelled = level(height_map)
    search = LineSearch(None, ALPHANUMERIC, height_mm=height_mm)
    heights = felt_heights_mm(search, levelled, soil=soil)[:MOST_SCANS]
    feel = virtual_feel(soil=soil)
    best: tuple[float, tuple[Cut, ...]] | None = None
    problem: ExemplarError | None = None
    for height in heights:
        try:
            cuts = cut_scan(feel(levelled, height), text, height_mm=height_mm)
        except ExemplarError as error:
            problem = problem or error
            continue
        mean = float(np.mean([cut.score for cut in cuts])) if cuts else 0.0
        if best is None or mean > best[0]:
            best = (mean, cuts)
        if mean > good_score:
            break
    if best is None:
        raise problem or ExemplarError("no characters found", hint="look at the part, or give its height")
    return best[1]
