"""Fill the lines of an excluded whisker from the passes that cross them.

x passes  -->  ====xxxxxxx====    xxxx: under the faulty whisker
y passes   |   height h from both y directions, traced by other whiskers
           v   slope along x = dh/dx, and (16) gives m / m_land = (1 + h/d0) F(slope, mu)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glyphs.errors import MarksError
from glyphs.surface.maps import OPPOSITE_DIRECTIONS, EdgeMap, TraceDirection
from whisker_array.arrays import Floats, Mask
from whisker_array.estimation.estimate import is_profiler
from whisker_array.estimation.relief import relief_from_edges
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.touch import Touch


def fill_from_crossing(
    layers: Sequence[Floats],
    known: Sequence[Mask],
    directions: tuple[TraceDirection, ...],
    *,
    touch: Touch,
    pitch_mm: float,
) -> tuple[list[Floats], list[Mask]]:
    """Fill unknown samples (rows, cols) of one pair of directions from the pair that crosses it, where known."""
    layers, known, profiler = list(layers), list(known), is_profiler(touch.tip)
    layer_of = {direction: k for k, direction in enumerate(directions)}
    measured = [layer.copy() for layer in known]
    for axis, pair in enumerate(OPPOSITE_DIRECTIONS):
        other = OPPOSITE_DIRECTIONS[1 - axis]
        if not all(d in layer_of for d in (*pair, *other)):
            continue
        crossing = [layer_of[d] for d in other]
        sure = measured[crossing[0]] & measured[crossing[1]]
        try:
            edges = EdgeMap(
                enhancement=np.stack([np.where(sure, layers[k], 0.0) for k in crossing]).astype(np.float32),
                directions=other,
                valid=sure,
                pitch_mm=pitch_mm,
            )
            height = relief_from_edges(edges, touch).height_mm.astype(np.float64)
        except MarksError:
            continue
        slope = np.gradient(height, pitch_mm, axis=1 - axis)
        for direction in pair:
            k = layer_of[direction]
            factor = 1.0 if profiler else moment_ratio(direction.sign * slope, touch.friction, touch.tip)
            expected = (1.0 + height / touch.preload_mm) * factor - 1.0
            take = sure & ~measured[k] & np.isfinite(expected)
            layers[k] = np.where(take, expected, layers[k])
            known[k] = known[k] | take
    return layers, known
