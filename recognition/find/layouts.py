"""Recognise layouts that are not read.

    mirrored    a line reads well in the mirrored view
    stacked     the pieces of a line that runs up or down, laid side by side, read well
    two lines   the texts of two lines together fit the format

Only a doubtful part is looked at again. Lines on an arc are read (`recognition.lines`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy import ndimage

from recognition.combine.read_line import ReadLine
from recognition.language.constrained_decoding import choose
from recognition.lines.moves import lengthen
from recognition.search.line_reader import LineReader
from recognition.search.line_search import is_convincing, promise_of
from recognition.search.part_lines import PartLines
from recognition.views.text_line import TextLine
from recognition.views.view import GREY, HEIGHTS, KNOWN, Layers, View


def other_layout(part: PartLines, view: View, lines: LineReader) -> str:
    """Describe the first other layout in which a part reads well; empty if there is none.

    Args:
        part: lines of the part that were read.
        view: view that was read.
        lines: reader of lines on such views.
    """
    return next(_layouts(part, view, lines), "")


def _layouts(
    part: PartLines, view: View, lines: LineReader, *, least_gain_nats: float = 2.0
) -> Iterator[str]:
    """Describe the layouts in which the part reads well.

    Args:
        part, view, lines: as in `other_layout`.
        least_gain_nats: promise by which a line in another layout must exceed the one that was read.
    """
    search = lines.search
    candidates = list(part.candidates) if part.main is None else [part.main.line, *part.candidates]
    least = least_gain_nats + (0.0 if part.main is None else promise_of(part.main))

    def reads_well(read: Sequence[ReadLine]) -> str:
        good = is_convincing(read, search.limits.sure) and promise_of(read[0]) > least
        return choose(read[0].lattice, lines.grammar).text if good else ""

    mirrored = view.mirrored
    there = search.candidates(mirrored)[: search.limits.most_lines]
    if text := reads_well(search.read_once(mirrored, [*there, *(line.reversed for line in there)])):
        yield f"the marks look mirrored: in a mirror they read “{text}” (mirror the picture or the map)"
    lengths = () if lines.grammar is None else sorted(lines.grammar.lengths() or ())[:3]
    for line, places in [*((line, lengths) for line in candidates), *_columns(candidates)]:
        columns = (search.read_once(*column) for column in _laid_side_by_side(view, line, places))
        if text := reads_well(
            max(columns, key=lambda read: promise_of(read[0]) if read else -math.inf, default=[])
        ):
            yield f"the characters stand below each other and read “{text}” (columns are not accepted; type it)"
    yield from _two_lines(candidates, view, lines)


def _columns(
    pieces: Sequence[TextLine], *, least_pieces: int = 3, aligned: float = 0.6
) -> list[tuple[TextLine, tuple[int, ...]]]:
    """Column through lines below each other, which may be its characters, and its number of places.

    Args:
        pieces: lines of a part, the most promising first.
        least_pieces: least number of lines in a column.
        aligned: greatest distance of a line's middle from the column, character heights.
    """
    if len(pieces) < least_pieces:
        return []
    middles = np.array([line.centre_mm.mean(axis=0) for line in pieces])
    height_mm = float(np.median([line.height_mm for line in pieces]))
    x_mm = float(np.median(middles[:, 0]))
    y_mm = np.sort(middles[np.abs(middles[:, 0] - x_mm) <= aligned * height_mm, 1])
    if y_mm.size < least_pieces or np.ptp(y_mm) < least_pieces * height_mm:
        return []
    steps_mm = np.diff(y_mm)
    n = round(np.ptp(y_mm) / steps_mm[steps_mm > 0.5 * height_mm].min()) + 1
    ends = np.array([[x_mm, y_mm[0] - 0.5 * height_mm], [x_mm, y_mm[-1] + 0.5 * height_mm]])
    return [(TextLine(ends, height_mm), (n,))]


def _two_lines(
    candidates: Sequence[TextLine],
    view: View,
    lines: LineReader,
    *,
    least_step: float = 0.8,
    alike: float = 1.6,
    clear: float = 0.8,
) -> Iterator[str]:
    """Describe the first two lines, one above the other, whose texts fit the format together.

    Args:
        candidates, view, lines: as in `other_layout`.
        least_step: least distance from one line down to the other, character heights.
        alike: greatest ratio of the heights of their characters.
        clear: least mean probability of the characters of each.
    """
    if lines.grammar is None:
        return
    search = lines.under(None).search
    read = search.read_once(view, [*candidates, *search.candidates(view)[: search.limits.most_lines]])
    clearly = [
        (line.line, open_places.text)
        for line in read
        if (open_places := line.open_places[0]).n_places
        and float(np.exp(open_places.log_belief.max(axis=1)).mean()) >= clear
    ]
    for (upper, first), (lower, second) in permutations(clearly, 2):
        heights = sorted((upper.height_mm, lower.height_mm))
        step_mm = float((lower.centre_mm.mean(axis=0) - upper.centre_mm.mean(axis=0))[1])
        apart = step_mm >= least_step * heights[1] and heights[1] <= alike * heights[0]
        if apart and not lines.grammar.objections(first + second):
            what = f"two lines read “{first}” and “{second}”, which fit the format together"
            yield f"{what} (give --format for one and --line for the other)"


def _laid_side_by_side(
    view: View, line: TextLine, lengths: Sequence[int], *, usual_gap: float = 0.35
) -> Iterator[tuple[View, list[TextLine]]]:
    """Cut a line that runs up or down into its characters, and lay them side by side from the top.

    It is cut where there is land between the characters, and into equal pieces.

    Args:
        view: view of the part.
        line: line that was found.
        lengths: possible numbers of characters.
        usual_gap: land between two characters in equal pieces, character heights.

    Yields:
        The view of the pieces, and lines through them; nothing if the line does not run up or down.
    """
    if not 60.0 <= abs(line.turned_deg) <= 120.0:
        return
    ends = lengthen(line, 0.5, 0.5).centre_mm
    reach = (0.9 * line.height_mm, 0.0)
    corners = (
        np.stack([ends.min(axis=0) - reach, ends.max(axis=0) + reach]) - view.origin_mm
    ) / view.pitch_mm
    rows, columns = view.layers.shape[1:]
    (left, top), (right, bottom) = np.clip(np.rint(corners), 0, (columns, rows)).astype(int)
    band = view.layers[:, top:bottom, left:right]
    if min(band.shape[1:]) < 8:
        return
    pieces = _inked_rows(band)
    cuts = [pieces] if pieces else []
    for n in lengths if pieces else ():
        first, last = pieces[0][0], pieces[-1][1]
        high = (last - first) / (n + usual_gap * (n - 1))
        starts = first + high * (1.0 + usual_gap) * np.arange(n)
        cuts.append([(round(start), round(start + high)) for start in starts])
    for cut in cuts:
        if (laid := _tiles(view, band, cut)) is not None:
            yield laid


def _tiles(
    view: View,
    band: Layers,
    pieces: Sequence[tuple[int, int]],
    *,
    least_pieces: int = 3,
    alike: float = 1.6,
    margin: float = 0.4,
) -> tuple[View, list[TextLine]] | None:
    """Lay pieces of a column side by side; None if they are too few or unlike.

    Args:
        view: view that is cut.
        band: (LAYERS, rows, columns) the column.
        pieces: first and last row of each character.
        least_pieces: least number of characters of a column.
        alike: greatest ratio of a piece's height and the usual one.
        margin: land around a character, character heights.
    """
    highs = np.array([last - first for first, last in pieces], dtype=np.float64)
    usual = float(np.median(highs))
    if highs.size < least_pieces or usual < 4.0 or np.abs(np.log(highs / usual)).max() > math.log(alike):
        return None
    around = round(margin * usual)
    size = round(usual) + 2 * around
    padded = np.pad(band, ((0, 0), (size, size), (around, around)))
    tops = [size + (first + last - size) // 2 for first, last in pieces]
    layers = np.concatenate([padded[:, top : top + size] for top in tops], axis=2)
    length_mm, middle_mm = (0.5 * n * view.pitch_mm for n in (2 * layers.shape[2] - 2, size - 1))
    lines = [
        TextLine.straight(0.0, middle_mm, length_mm=length_mm, height_mm=scale * usual * view.pitch_mm)
        for scale in (0.9, 1.0, 1.1)
    ]
    return replace(view, layers=layers, origin_mm=(0.0, 0.0)), lines


def _inked_rows(band: Layers, *, least_ink: float = 0.15, closed: float = 0.06) -> list[tuple[int, int]]:
    """First and last row of each stretch of ink down a column.

    Args:
        band: (LAYERS, rows, columns) the column.
        least_ink: ink of a row, relative to an inked one, from which it is no land.
        closed: gaps within a character that are closed, widths of the column.
    """
    surface = band[HEIGHTS] if band[HEIGHTS].any() else band[GREY]
    slope = np.hypot(*np.gradient(surface)) * band[KNOWN]
    ink = np.minimum(slope, np.percentile(slope, 98.0)).mean(axis=1)
    land, inked = np.percentile(ink, (5.0, 75.0))
    reach = max(1, round(closed * band.shape[2]))
    rows = ndimage.binary_closing(np.pad(ink > land + least_ink * (inked - land), reach), iterations=reach)
    labels, _ = ndimage.label(rows[reach:-reach])
    stretches = [(stretch[0].start, stretch[0].stop) for stretch in ndimage.find_objects(labels)]
    return [(first, last) for first, last in stretches if last - first > 2 * reach]
