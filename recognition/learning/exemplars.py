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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.surface.maps import EdgeMap
from recognition.belief.line_reader import LineReader
from recognition.belief.line_search import LineSearch
from recognition.experts.recogniser import CHARACTERS
from recognition.language.grammar import Grammar
from recognition.learning.tactile_cell import ACROSS, DOWN, Cell, Layer, Place, felt_cell, ink_box
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import HEIGHTS, KNOWN, Layers, felt_view
from whisker_array.estimation.relief import Relief


class ExemplarError(MarksError):
    """A part of which nothing can be cut."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One character as it was felt.

    Attributes:
        char: what it is, as the reviewer says.
        relief: (rows, cols) float32 height over the land in character heights, a mark is negative however it was
            stamped; NaN where not known or where a neighbour stands.
        height_mm: character height of its line.
        rotation_deg: of its line.
        raised: whether the marks stand out.
        score: posterior of a character, mean of the text.
    """

    char: str
    relief: NDArray[np.float32]
    height_mm: float
    rotation_deg: float
    raised: bool
    score: float


def cut_line(
    edges: EdgeMap,
    relief: Relief,
    text: str,
    *,
    height_mm: float | None = None,
    line: TextLine | None = None,
    least_likely: float = 0.15,
) -> tuple[Cut, ...]:
    """The characters of a part's line.

    Args:
        edges: of the part.
        relief: the surface as felt.
        text: what stands there; blanks do not count.
        height_mm: character height, if known.
        line: where it stands, if known.
        least_likely: posterior of a character, mean of the text, below which it does not fit the marks.

    Returns:
        A cut a character, in order; those of which too little was felt are left out.

    Raises:
        ExemplarError: no text, or no marks that it fits.
    """
    plain = "".join(text.split())
    if not plain:
        raise ExemplarError("the text is empty", hint="only parts whose text is known can be enrolled")
    chars = "".join(sorted({*CHARACTERS, *plain} - {" "}))
    reader = LineReader(LineSearch(Grammar(sets=tuple(plain)), chars, height_mm=height_mm))
    view = felt_view(edges, relief)
    found = reader.read(view, about=line).main
    if found is None:
        raise ExemplarError(
            "no line of marks as long as the text was found", hint="look at the part and its text"
        )
    likely = np.exp(found.belief.evidence / len(plain))
    if likely < least_likely:
        raise ExemplarError(
            f"the text does not fit the marks (belief {likely:.2f} a character)", hint="see that it is right"
        )
    raised = _stands_out(view.strip(found.line))
    middles = ((found.belief.columns + 0.5) / HEIGHT_ROWS - MARGIN) * found.line.height_mm
    line_at, places = _fit_size(relief, found.line, [(float(u), 0.0) for u in middles], raised=raised)
    bounds = _bounds(relief, line_at, places, raised=raised)
    cells = [felt_cell(relief, line_at, place, raised=raised) for place in places]
    return tuple(
        Cut(char, shape, line_at.height_mm, line_at.turned_deg, raised, float(likely))
        for char, cell, reach in zip(plain, cells, bounds, strict=True)
        if (shape := _own_shape(cell, line_at.height_mm, reach)) is not None
    )


def _stands_out(strip: Layers) -> bool:
    """Whether a line is raised: its marks are the smaller part of its strip, and lie on that side of the land."""
    known = strip[KNOWN] > 0.0
    heights = strip[HEIGHTS][known]
    if heights.size == 0:
        return False
    off = heights - np.median(heights)
    return bool((off**3).sum() > 0.0)


def _fit_size(
    relief: Relief, line: TextLine, places: Sequence[Place], *, raised: bool, tolerance: float = 0.1
) -> tuple[TextLine, list[Place]]:
    """The line with the height of its own ink, whatever font found it, and the middle of every character.

    Args:
        relief: as felt.
        line: as found.
        places: of its characters.
        raised: whether its marks stand out.
        tolerance: share of the line's height by which a character of full height may differ; others are placed by
            the line.
    """
    places = list(places)
    for _ in range(2):
        height = line.height_mm
        bounds = _bounds(relief, line, places, raised=raised)
        cells = (felt_cell(relief, line, place, raised=raised) for place in places)
        boxes = [ink_box(cell, height, bounds=reach) for cell, reach in zip(cells, bounds, strict=True)]
        inked = [box for box in boxes if box is not None]
        if not inked:
            raise ExemplarError(
                "nothing is sunk or raised where the text should stand", hint="look at the scan"
            )
        typical = float(np.median([box[3] - box[1] for box in inked]))

        def is_full(box: Cell) -> bool:
            return abs(box[3] - box[1] - typical) < tolerance * height  # noqa: B023

        shift = float(np.median([0.5 * (box[1] + box[3]) for box in inked if is_full(box)] or [0.0]))
        places = [
            (u, v)
            if box is None
            else (u + 0.5 * (box[0] + box[2]), v + (0.5 * (box[1] + box[3]) if is_full(box) else shift))
            for (u, v), box in zip(places, boxes, strict=True)
        ]
        line = TextLine(line.centre_mm, float(np.clip(typical, 0.8 * height, 1.25 * height)))
    return line, places


def _bounds(
    relief: Relief, line: TextLine, places: Sequence[Place], *, raised: bool, gap_pull: float = 2.0
) -> list[tuple[float, float]]:
    """Return the reach of each character's cell to its left and right, mm: to the least ink between two.

    Args:
        relief, line, places, raised: as of `_fit_size`.
        gap_pull: ink, as a share of the fullest column's, that a gap may have rather than lie a whole spacing off the
            middle.
    """
    u = ACROSS * line.height_mm
    far = float(u[-1])
    left, right = [far] * len(places), [far] * len(places)
    for k in range(len(places) - 1):
        (u0, v0), (u1, v1) = places[k], places[k + 1]
        apart = u1 - u0
        felt = felt_cell(relief, line, (0.5 * (u0 + u1), 0.5 * (v0 + v1)), raised=raised)
        ink = np.clip(-np.nan_to_num(felt), 0.0, None).sum(axis=0)
        # the gap lies about half way; between the legs of a U there is little ink, too
        cost = ink / max(float(ink.max()), 1e-12) + gap_pull * (u / max(apart, 1e-9)) ** 2
        gap = float(u[np.argmin(np.where(np.abs(u) < 0.4 * apart, cost, np.inf))])
        right[k], left[k + 1] = min(far, 0.5 * apart + gap), min(far, 0.5 * apart - gap)
    return list(zip(left, right, strict=True))


def _own_shape(
    felt: Layer, height_mm: float, bounds: tuple[float, float], *, least_known: float = 0.7
) -> NDArray[np.float32] | None:
    """Return a cell within its bounds, in character heights; None where less than a share of its middle was felt."""
    middle = felt[np.ix_(np.abs(DOWN) < 0.5, np.abs(ACROSS) < 0.3)]
    if np.isfinite(middle).mean() < least_known:
        return None
    own = (ACROSS * height_mm > -bounds[0]) & (ACROSS * height_mm < bounds[1])
    # sixteen bits are more than was felt, and pack well
    return np.asarray(np.where(own, felt / height_mm, np.nan).astype(np.float16), dtype=np.float32)
