"""A plate that lies a quarter, a half or three quarters of a turn askew.

What touch measured is turned upright and read; the reading is turned back into the plate frame, and its rotation
says how the plate lies::

    +-----------+   turned by 2    +-----------+  read   AB 12, turned back: boxes of the plate,
    |   21 BA   |  ------------->  |   AB 12   |  ---->  rotation_deg = rotation + 180
    +-----------+                  +-----------+

Quarters are counted against the clock as one looks at row 0 on top. All turns are about the middle of the edge map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from recognition.box import Box
from recognition.reading import Decision, Reading
from whisker_array.estimation.relief import Relief

BETTER_SUPPORT = 1.25
"""Length of line explained over that of the plate as it lies, from which a turned plate is believed. Upside down dirty
and clean serials are explained 1.6 times better when turned; 80168 reads either way, and stays as it lies."""


def is_better(turned: Reading, other: Reading) -> bool:
    """Whether the plate is believed to lie turned so, rather than as in the other reading."""
    return (
        turned.decision is not Decision.REJECT
        and turned.confidence > other.confidence
        and turned.trace.support_mm > BETTER_SUPPORT * other.trace.support_mm
    )


def turned_map(height_map: HeightMap, quarters: int) -> HeightMap:
    """The height map of a plate turned so far."""
    return HeightMap(np.rot90(height_map.z_mm, quarters), height_map.pitch_mm)


def turned_edges(edges: EdgeMap, quarters: int) -> EdgeMap:
    """What touch would have felt of the plate turned so far."""
    layers = {
        TraceDirection((d - 90 * quarters) % 360): np.rot90(layer, quarters)
        for d, layer in zip(edges.directions, edges.enhancement, strict=True)
    }
    directions = tuple(d for d in TraceDirection if d in layers)
    return EdgeMap(
        np.stack([layers[d] for d in directions]),
        directions,
        np.rot90(edges.valid, quarters),
        edges.pitch_mm,
        _origin(edges, edges.origin_mm, edges.pitch_mm, edges.shape, quarters),
    )


def turned_heights(relief: Relief, quarters: int, *, edges: EdgeMap) -> Relief:
    """Heights by touch of the plate turned so far, without slopes; `edges` as the plate lies."""
    shape = (relief.height_mm.shape[0], relief.height_mm.shape[1])
    return replace(
        relief,
        height_mm=np.rot90(relief.height_mm, quarters),
        slope_x=None,
        slope_y=None,
        friction_map=None,
        origin_mm=_origin(edges, relief.origin_mm, relief.pitch_mm, shape, quarters),
    )


def turned_back(reading: Reading, quarters: int, *, edges: EdgeMap) -> Reading:
    """A reading of the plate turned so far, in the frame of the plate as it lies; `edges` likewise."""
    back = _turn_about(edges, -quarters)
    rotation = (reading.rotation_deg + 90.0 * quarters + 180.0) % 360.0 - 180.0
    lattice = reading.trace.lattice
    if lattice is not None:
        lattice = replace(lattice, boxes=tuple(_box(box, back) for box in lattice.boxes))
    return replace(
        reading,
        characters=tuple(replace(c, box=_box(c.box, back)) for c in reading.characters),
        box=None if reading.box is None else _box(reading.box, back),
        rotation_deg=rotation,
    ).traced(lattice=lattice)


Turn = Callable[[float, float], tuple[float, float]]


def _turn_about(edges: EdgeMap, quarters: int) -> Turn:
    """Plate coordinates to those of the plate turned about the middle of its edge map."""
    rows, cols = edges.shape
    x = edges.origin_mm[0] + 0.5 * (cols - 1) * edges.pitch_mm
    y = edges.origin_mm[1] + 0.5 * (rows - 1) * edges.pitch_mm
    cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    return lambda u, v: (x + cos * (u - x) + sin * (v - y), y - sin * (u - x) + cos * (v - y))


def _box(box: Box, turn: Turn) -> Box:
    xs, ys = zip(turn(box.x0_mm, box.y0_mm), turn(box.x1_mm, box.y1_mm), strict=True)
    return Box(min(xs), min(ys), max(xs), max(ys))


def _origin(
    edges: EdgeMap, origin_mm: tuple[float, float], pitch_mm: float, shape: tuple[int, int], quarters: int
) -> tuple[float, float]:
    """First sample of a turned grid."""
    last = (origin_mm[0] + (shape[1] - 1) * pitch_mm, origin_mm[1] + (shape[0] - 1) * pitch_mm)
    box = _box(Box(*origin_mm, *last), _turn_about(edges, quarters))
    return (box.x0_mm, box.y0_mm)
