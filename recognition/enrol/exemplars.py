"""Characters cut out of a part whose text is known, for the glyph database.

Forced alignment of the recogniser to the known text finds where each character stands. What was felt there is resampled
upright at 40 pixels per character height. The middle is the ink's middle across, and half the character height up::

          plate frame                      cut, in the line's frame
       _____________________                +-----------+
      |    K  7  B  2  9    |   ------->    |    K      |  ...
      |_____________________|               +-----------+
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.errors import MarksError
from glyphs.fonts.glyph import RELIEF_PIXELS
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from recognition.find.find import find
from recognition.find.first_pass import felt_heights_mm, virtual_feel
from recognition.find.request import LineRequest
from recognition.language.grammar import Grammar
from recognition.language.remainders import ALPHANUMERIC
from recognition.recogniser.recogniser import CHARACTERS
from recognition.see.levelling import level, square_to_plate
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine
from recognition.see.view import HEIGHTS, KNOWN, Layers, felt_view, relief_of
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.relief import Relief
from whisker_array.scan.scan import Scan

Floats = NDArray[np.float64]

DOWN, ACROSS = np.arange(-26, 27) / RELIEF_PIXELS, np.arange(-32, 33) / RELIEF_PIXELS
"""Rows and columns of a cell from its middle, character heights: a W of a wide font and some land."""
DEEP_PERCENT = 97.0
"""Percentile of a cell's samples that is the depth of its mark."""


class ExemplarError(MarksError):
    """No character of a part can be cut out."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One felt character."""

    char: str
    # (rows, cols) float32 height over the land in character heights; marks are negative, whether sunk or
    # raised; NaN where unknown or where a neighbour stands
    relief: NDArray[np.float32]
    height_mm: float
    rotation_deg: float
    raised: bool
    score: float  # geometric mean posterior per character
    place: int


def cut_height_map(
    height_map: HeightMap,
    text: str,
    *,
    soil: Soil | None = None,
    height_mm: float | None = None,
    good_score: float = 0.7,
) -> tuple[Cut, ...]:
    """Cut out the characters of a height map, scanned as for reading (`cut_scan`). Raises ExemplarError, MapError."""
    height_map, soil = square_to_plate(height_map, soil)
    levelled, feel = level(height_map), virtual_feel(soil=soil)
    heights = felt_heights_mm(LineRequest(None, ALPHANUMERIC, height_mm=height_mm), levelled, soil=soil)
    cuts: list[tuple[Cut, ...]] = []
    problems: list[ExemplarError] = []
    for height in heights:
        try:
            cuts.append(cut_scan(feel(levelled, height), text, height_mm=height_mm))
        except ExemplarError as error:
            problems.append(error)
            continue
        if _score(cuts[-1]) > good_score:
            break
    if not cuts:
        problems.append(
            ExemplarError("no characters found", hint="check the part, or give the character height")
        )
        raise problems[0]
    return max(cuts, key=_score)


def _score(cuts: tuple[Cut, ...]) -> float:
    return cuts[0].score if cuts else 0.0


def cut_scan(
    scan: Scan, text: str, *, height_mm: float | None = None, least_likely: float = 0.15
) -> tuple[Cut, ...]:
    """Cut out the characters of a recorded scan of which enough was felt. Raises ExemplarError, MapError."""
    edges = edge_map(scan)
    relief, plain = relief_of(scan, edges), "".join(text.split())
    if relief is None:
        raise ExemplarError(
            "the scan gives no heights", hint="record it with the default whisker, all directions"
        )
    if not plain:
        raise ExemplarError("the text is empty", hint="only parts whose text is known can be enrolled")
    chars = "".join(sorted({*CHARACTERS, *plain} - {" "}))
    view = felt_view(edges, relief)
    request = LineRequest(Grammar(sets=tuple(plain)), chars, height_mm=height_mm)
    read = find([view], request).main
    if read is None:
        raise ExemplarError(
            "found no line of marks with as many characters as the text", hint="look at the part and its text"
        )
    mean_posterior = float(np.exp(read.evidence / len(plain)))
    if mean_posterior < least_likely:
        raise ExemplarError(
            f"the text does not fit the marks (mean posterior {mean_posterior:.2f} per character)",
            hint="check the text",
        )
    raised = _stands_out(view.strip(read.line))
    along = ((read.columns + 0.5) / HEIGHT_ROWS - MARGIN) * read.line.height_mm
    line, places = _fit_size(relief, read.line, np.column_stack([along, np.zeros(along.size)]), raised)
    cuts = []
    cells = zip(plain, places, _bounds(relief, line, places, raised), strict=True)
    for number, (char, place, reach) in enumerate(cells, start=1):
        shape = _own_shape(felt_cell(relief, line, place, raised), line.height_mm, reach)
        if shape is not None:
            cuts.append(Cut(char, shape, line.height_mm, line.turned_deg, raised, mean_posterior, number))
    return tuple(cuts)


def _stands_out(strip: Layers) -> bool:
    known = strip[KNOWN] > 0.0
    heights = strip[HEIGHTS][known]
    if heights.size == 0:
        return False
    off = heights - np.median(heights)
    return bool((off**3).sum() > 0.0)


def _fit_size(
    relief: Relief,
    line: TextLine,
    places: Floats,  # (n, 2) of its characters, along the line from its start and down from it, mm
    raised: bool,
    *,
    # a character whose ink differs less than this from the median height (share of the line's height) counts as
    # full height; the others get the median vertical shift
    tolerance: float = 0.1,
) -> tuple[TextLine, Floats]:
    for _ in range(2):
        height = line.height_mm
        cells = (felt_cell(relief, line, place, raised) for place in places)
        reaches = _bounds(relief, line, places, raised)
        boxes = np.array([_ink_box(*cell, height) for cell in zip(cells, reaches, strict=True)])
        inked = np.isfinite(boxes[:, 0])
        if not inked.any():
            raise ExemplarError(
                "nothing is sunk or raised where the text should stand", hint="look at the scan"
            )
        high = boxes[:, 3] - boxes[:, 1]
        typical = float(np.median(high[inked]))
        full = np.abs(high - typical) < tolerance * height
        across, down = 0.5 * (boxes[:, :2] + boxes[:, 2:]).T
        shift = float(np.median(down[full])) if full.any() else 0.0
        moved = places + np.column_stack([across, np.where(full, down, shift)])
        places = np.where(inked[:, None], moved, places)
        line = TextLine(line.centre_mm, float(np.clip(typical, 0.8 * height, 1.25 * height)))
    return line, places


def _bounds(relief: Relief, line: TextLine, places: Floats, raised: bool, *, gap_pull: float = 2.0) -> Floats:
    u = ACROSS * line.height_mm
    apart, gaps = np.diff(places[:, 0]), []
    for between, wide in zip(0.5 * (places[:-1] + places[1:]), apart, strict=True):
        felt = felt_cell(relief, line, between, raised)
        ink = np.clip(-np.nan_to_num(felt), 0.0, None).sum(axis=0)
        # the gap lies about half way; between the legs of a U there is little ink, too
        cost = ink / max(float(ink.max()), 1e-12) + gap_pull * (u / max(wide, 1e-9)) ** 2
        gaps.append(float(u[np.argmin(np.where(np.abs(u) < 0.4 * wide, cost, np.inf))]))
    reach = np.stack([np.r_[np.inf, 0.5 * apart - gaps], np.r_[0.5 * apart + gaps, np.inf]], axis=1)
    return np.asarray(np.minimum(reach, u[-1]))


def _own_shape(
    felt: Floats, height_mm: float, bounds: Floats, *, least_known: float = 0.7
) -> NDArray[np.float32] | None:
    middle = felt[np.ix_(np.abs(DOWN) < 0.5, np.abs(ACROSS) < 0.3)]
    if np.isfinite(middle).mean() < least_known:
        return None
    within = (ACROSS * height_mm > -bounds[0]) & (ACROSS * height_mm < bounds[1])
    # float16 is finer than the measurement, and compresses well
    return np.asarray(np.where(within, felt / height_mm, np.nan).astype(np.float16), dtype=np.float32)


def felt_cell(relief: Relief, line: TextLine, place: Floats, raised: bool) -> Floats:
    """(rows, columns) heights about a place over their land, mm, negative in the mark; NaN where unknown."""
    along, down = place / line.height_mm
    columns = (along + MARGIN + ACROSS) * HEIGHT_ROWS - 0.5
    rows = (down + DOWN) * HEIGHT_ROWS + 0.5 * ROWS - 0.5
    places = (line.places_mm(columns, rows[:, None]) - relief.origin_mm) / relief.pitch_mm
    z = relief.height_mm.astype(np.float64)
    felt = ndimage.map_coordinates(z, (places[..., 1], places[..., 0]), order=1, mode="constant", cval=np.nan)
    return _over_land(-felt if raised else felt)


def _over_land(
    felt: Floats,
    *,
    land_share: float = 0.35,
    rounds: int = 4,
    least_land: int = 60,
) -> Floats:
    # over a bowl, as the plate's waves may be as deep as a worn mark; a bold character covers more of its cell than
    # it leaves, which a fit by Tukey's weights does not survive
    known = np.isfinite(felt)
    if known.sum() < least_land:
        return felt
    v, u = np.meshgrid(DOWN, ACROSS, indexing="ij")
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    # first guess: the upper half of the samples is land
    land, over = known & (felt >= np.median(felt[known])), felt
    for _ in range(rounds):
        if land.sum() < least_land:
            break
        over = felt - terms @ np.linalg.lstsq(terms[land], felt[land], rcond=None)[0]
        deep = float(np.percentile(-over[known], DEEP_PERCENT))
        land = known & ~ndimage.binary_dilation(np.nan_to_num(over) < -land_share * deep, iterations=2)
    return over


def _ink_box(felt: Floats, bounds: Floats, height_mm: float, *, ink_share: float = 0.5) -> Floats:
    u, v = ACROSS * height_mm, DOWN * height_mm
    depth = np.where((u > -bounds[0]) & (u < bounds[1]), -np.nan_to_num(felt), 0.0)
    deep = float(np.percentile(depth[np.abs(DOWN) < 0.5], DEEP_PERCENT))
    ink = depth > max(ink_share * deep, 0.0)
    across, down = np.flatnonzero(ink.sum(axis=0) >= 2), np.flatnonzero(ink.sum(axis=1) >= 2)
    if deep <= 0.0 or not across.size or not down.size:
        return np.full(4, np.nan)
    # extend the box from `ink_share` of the depth up to the land, along a 45-degree wall
    wall = ink_share * deep + 0.5 * height_mm / RELIEF_PIXELS
    return np.array([u[across[0]] - wall, v[down[0]] - wall, u[across[-1]] + wall, v[down[-1]] + wall])
