"""Characters cut out of a part whose text is known, for the glyph database.

The text is forced on the recogniser's alignment: it says where the characters stand, not which. What was felt there
is then sampled to one size, upright, 40 pixels to the height, the middle of the ink across and half the height up
in the middle::

          plate frame                      cut, in the line's frame
       _____________________                +-----------+
      |    K  7  B  2  9    |   ------->    |    K      |  ...
      |_____________________|               +-----------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.fonts.glyph import RELIEF_PIXELS
from glyphs.surface.maps import EdgeMap
from recognition.belief.line_reader import LineReader
from recognition.experts.recogniser import CHARACTERS
from recognition.language.grammar import Grammar
from recognition.learning.tactile_cell import (
    HALF_COLUMNS_HEIGHTS,
    LineFrame,
    cell_grid,
    felt_cell,
    ink_box,
    plate_of_cell,
)
from recognition.lines.places import places_mm
from recognition.views.text_line import TextLine
from recognition.views.view import HEIGHTS, KNOWN, Layers, felt_view
from whisker_array.estimation.relief import Relief

LEAST_LIKELY = 0.15
"""Belief a character in the text as a whole, below which it does not fit the marks."""
FULL_HEIGHT_TOLERANCE = 0.1
"""Share of the line's height by which a character of full height may differ; others are placed by the line."""
GAP_PULL = 2.0
"""Ink, as a share of the fullest column's, that a gap may have rather than lie a whole spacing off the middle."""
LEAST_KNOWN = 0.7
"""Share of a cut's middle that must have been felt."""


class ExemplarError(MarksError):
    """A part of which nothing can be cut."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One character as it was felt.

    Attributes:
        char: what it is, as the reviewer says.
        edge_map: the felt layers in the line's frame, RELIEF_PIXELS to the height, origin such that (0, 0) is the
            reference point; directions are those of the plate frame.
        relief: (rows, cols) float32 height over the land in character heights, a mark is negative however it was
            stamped; NaN where not known or where a neighbour stands.
        height_mm: character height of its line.
        rotation_deg: of its line.
        raised: whether the marks stand out.
        score: belief a character that the text stands there.
    """

    char: str
    edge_map: EdgeMap
    relief: NDArray[np.float32]
    height_mm: float
    rotation_deg: float
    raised: bool
    score: float


@dataclass(frozen=True)
class _Line:
    """A line before its characters are cut out."""

    height_mm: float
    raised: bool


def cut_line(
    edges: EdgeMap, relief: Relief, text: str, *, height_mm: float | None = None, line: TextLine | None = None
) -> tuple[Cut, ...]:
    """The characters of a part's line.

    Args:
        edges: of the part.
        relief: the surface as felt.
        text: what stands there; blanks do not count.
        height_mm: character height, if known.
        line: where it stands, if known.

    Returns:
        A cut a character, in order; those of which too little was felt are left out.

    Raises:
        ExemplarError: no text, or no marks that it fits.
    """
    plain = "".join(text.split())
    if not plain:
        raise ExemplarError("the text is empty", hint="only parts whose text is known can be enrolled")
    chars = "".join(sorted({*CHARACTERS, *plain} - {" "}))
    reader = LineReader(Grammar(sets=tuple(plain)), chars, height_mm=height_mm)
    view = felt_view(edges, relief)
    found = reader.read(view, about=line).main
    if found is None:
        raise ExemplarError(
            "no line of marks as long as the text was found", hint="look at the part and its text"
        )
    likely = np.exp(found.belief.evidence / len(plain))
    if likely < LEAST_LIKELY:
        raise ExemplarError(
            f"the text does not fit the marks (belief {likely:.2f} a character)", hint="see that it is right"
        )
    frame = LineFrame(found.line.turned_deg)
    middle = frame.from_plate(places_mm(found.line, found.belief.columns))
    line_at = _Line(found.line.height_mm, _stands_out(view.strip(found.line)))
    line_at, places = _fit_size(relief, line_at, middle, frame)
    bounds = _bounds(relief, frame, places, line_at.height_mm, raised=line_at.raised)
    made = (
        _cut_out(edges, relief, line_at, frame, place, reach, char=char, score=float(likely))
        for char, place, reach in zip(plain, places, bounds, strict=True)
    )
    return tuple(cut for cut in made if cut is not None)


def _stands_out(strip: Layers) -> bool:
    """Whether a line is raised: its marks are the smaller part of its strip, and lie on that side of the land."""
    known = strip[KNOWN] > 0.0
    heights = strip[HEIGHTS][known]
    if heights.size == 0:
        return False
    off = heights - np.median(heights)
    return bool((off**3).sum() > 0.0)


def _fit_size(
    relief: Relief, line: _Line, middles: NDArray[np.float64], frame: LineFrame
) -> tuple[_Line, list[tuple[float, float]]]:
    """The line with the height of its own ink, whatever font found it, and the middle of every character."""
    height = line.height_mm
    places = [(float(u), float(v)) for u, v in middles]
    boxes: list[tuple[float, float, float, float] | None] = []
    for _ in range(2):
        bounds = _bounds(relief, frame, places, height, raised=line.raised)
        boxes = [
            ink_box(felt_cell(relief, frame, place, height, raised=line.raised), height, bounds=reach)
            for place, reach in zip(places, bounds, strict=True)
        ]
        known = [box for box in boxes if box is not None]
        if not known:
            raise ExemplarError(
                "nothing is sunk or raised where the text should stand", hint="look at the scan"
            )
        tall = [box[3] - box[1] for box in known]
        typical = float(np.median(tall))
        full = [
            box is not None and abs(box[3] - box[1] - typical) < FULL_HEIGHT_TOLERANCE * height
            for box in boxes
        ]
        rows = [
            places[k][1] + 0.5 * (box[1] + box[3])
            for k, box in enumerate(boxes)
            if box is not None and full[k]
        ]
        shift = float(np.median([r - places[k][1] for r, k in zip(rows, np.flatnonzero(full), strict=True)]))
        places = [
            (u, v)
            if box is None
            else (u + 0.5 * (box[0] + box[2]), v + (0.5 * (box[1] + box[3]) if full[k] else shift))
            for k, ((u, v), box) in enumerate(zip(places, boxes, strict=True))
        ]
        height = float(np.clip(typical, 0.8 * height, 1.25 * height))
    return replace(line, height_mm=height), places


def _bounds(
    relief: Relief,
    frame: LineFrame,
    places: Sequence[tuple[float, float]],
    height_mm: float,
    *,
    raised: bool,
) -> list[tuple[float, float]]:
    """Return the reach of each character's cell to its left and right, mm: to the least ink between two."""
    far = HALF_COLUMNS_HEIGHTS * height_mm
    left, right = [far] * len(places), [far] * len(places)
    for k in range(len(places) - 1):
        (u0, v0), (u1, v1) = places[k], places[k + 1]
        apart = u1 - u0
        felt = felt_cell(relief, frame, (0.5 * (u0 + u1), 0.5 * (v0 + v1)), height_mm, raised=raised)
        u = cell_grid(height_mm)[0][0]
        ink = np.clip(-np.nan_to_num(felt), 0.0, None).sum(axis=0)
        # the gap lies about half way; between the legs of a U there is little ink, too
        cost = ink / max(float(ink.max()), 1e-12) + GAP_PULL * (u / max(apart, 1e-9)) ** 2
        gap = float(u[np.argmin(np.where(np.abs(u) < 0.4 * apart, cost, np.inf))])
        right[k], left[k + 1] = min(far, 0.5 * apart + gap), min(far, 0.5 * apart - gap)
    return list(zip(left, right, strict=True))


def _cut_out(
    edges: EdgeMap,
    relief: Relief,
    line: _Line,
    frame: LineFrame,
    place: tuple[float, float],
    bounds: tuple[float, float],
    *,
    char: str,
    score: float,
) -> Cut | None:
    """Cut out the relief about a place; None where too little was felt."""
    from scipy.ndimage import map_coordinates

    height = line.height_mm
    felt = felt_cell(relief, frame, place, height, raised=line.raised)
    u, v = cell_grid(height)
    middle = (np.abs(u) < 0.3 * height) & (np.abs(v) < 0.5 * height)
    if np.isfinite(felt[middle]).mean() < LEAST_KNOWN:
        return None
    own = (u > -bounds[0]) & (u < bounds[1])
    x, y = plate_of_cell(frame, place, height)
    at = [(y - edges.origin_mm[1]) / edges.pitch_mm, (x - edges.origin_mm[0]) / edges.pitch_mm]
    layers = np.stack([map_coordinates(layer, at, order=1, mode="constant") for layer in edges.enhancement])
    valid = map_coordinates(edges.valid.astype(np.float32), at, order=1, mode="constant") > 0.99
    # sixteen bits are more than was felt, and pack well
    layers = np.where(valid & own, layers, 0.0).astype(np.float16).astype(np.float32)
    cut_map = EdgeMap(
        layers,
        edges.directions,
        valid & own,
        height / RELIEF_PIXELS,
        (float(u[0, 0]), float(v[0, 0])),
    )
    shape = np.where(own, felt / height, np.nan).astype(np.float16).astype(np.float32)
    return Cut(char, cut_map, shape, height, frame.rotation_deg, line.raised, score)
