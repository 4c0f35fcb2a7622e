"""Peak bending stress of any whisker on land, place by place: an oracle for the design's closed form."""

from __future__ import annotations

import numpy as np

from whisker_array.whisker.sections import Taper
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.validity import land_force_n


def preload_stress_mpa(whisker: Whisker, *, preload_mm: float, mu: float) -> float:
    """Peak bending stress M c / I on the land at this preload, MPa.

    Vertical and lateral bending are added (exact at the corners of a rectangle, on the safe side for round
    wire; a planar whisker has no lateral part). Looked at are both ends of every segment and 33 places of a
    taper.
    """
    force = land_force_n(whisker, preload_mm=preload_mm, mu=mu)
    segments = whisker.segments()
    tip = segments[-1].end_mm
    peak = 0.0
    for segment in segments:
        places = np.linspace(0.0, 1.0, 33 if isinstance(segment.section, Taper) else 2)
        _, lateral, vertical = segment.axes
        for t in places:
            section = segment.section_at(float(t))
            point = segment.start_mm + t * (segment.end_mm - segment.start_mm)
            moment = np.cross(tip - point, force)
            up_down = abs(float(moment @ lateral)) * section.c_vertical_mm / section.i_vertical_mm4
            sideways = abs(float(moment @ vertical)) * section.c_lateral_mm / section.i_lateral_mm4
            peak = max(peak, up_down + sideways)
    return peak
