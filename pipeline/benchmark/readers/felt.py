"""Maps of a felt part, which readers of pictures are shown.

The stage is set for the true character height where it is known, as a plant sets it; else for a usual one. So nothing
of our reader is in these maps.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glyphs.surface.display import one_line
from glyphs.surface.maps import EdgeMap, MapError
from pipeline.reading.scan_plan import USUAL_HEIGHT_MM

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Specimen
    from whisker_array.estimation.relief import Relief
    from whisker_array.scan.scan import Scan


@dataclass(frozen=True, eq=False)
class FeltMaps:
    """A scan by the default plan, or the part's own, and its maps.

    Attributes:
        scan: of the virtual array, with ideal sensors.
        edges: its edge map; None where nothing could be felt.
        relief: the heights; None likewise.
        simulated_s: what simulating the scan took.
    """

    scan: Scan
    edges: EdgeMap | None
    relief: Relief | None
    simulated_s: float

    __repr__ = one_line


def feel_part(specimen: Specimen) -> FeltMaps:
    """Scan a part by the default plan, or its own.

    Raises:
        MapError: a surface that cannot be scanned.
    """
    from pipeline.reading.simulated_scan import VirtualBench
    from recognition.views.view import relief_of
    from whisker_array.estimation.edges import edge_map

    start = time.perf_counter()
    surface, height_mm = specimen.height_map, specimen.height_mm or USUAL_HEIGHT_MM
    if specimen.feel is not None:
        scan = specimen.feel(surface, height_mm)
    else:
        scan = VirtualBench(surface, height_mm, noise=False, soil=specimen.soil).scan()
    simulated_s = time.perf_counter() - start
    try:
        edges = edge_map(scan)
    except MapError:
        return FeltMaps(scan, None, None, simulated_s)
    return FeltMaps(scan, edges, relief_of(scan, edges), simulated_s)
