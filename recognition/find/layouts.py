"""Layouts that are not read as a serial.

    upside down a line reads well from its other end, though the search passed it over
    mirrored    a line reads well in the mirrored view
    column      the pieces of a line that runs up or down, laid side by side, read well
    two lines   the texts of two lines together fit the format

Only a doubtful part is looked at again; an upside-down photograph is then read. Lines on an arc are always read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import permutations

import numpy as np
from scipy import ndimage

from recognition.find.line_variants import is_same_place, lengthen
from recognition.find.orientation import line_in_view
from recognition.find.promise import is_convincing, promise_of, share_of
from recognition.find.search import Search
from recognition.language.constrained_decoding import choose
from recognition.language.orientation import Way
from recognition.recogniser.read_line import ReadLine
from recognition.see.text_line import TextLine
from recognition.see.view import GREY, HEIGHTS, KNOWN, Layers, View


class LayoutKind(StrEnum):
    """Layouts of a serial that are recognised, but not read."""

    UPSIDE_DOWN = "upside down"
    MIRRORED = "mirrored"
    COLUMN = "column"
    TWO_LINES = "two lines"


@dataclass(frozen=True)
class Layout:
    """A layout in which a part reads well, with its text; an upside-down `line` is in reading direction."""

    kind: LayoutKind
    texts: tuple[str, ...]
    line: TextLine | None = None


def other_layout(
    search: Search,
    main: ReadLine | None,
    candidates: Sequence[TextLine],
    *,
    # probability of the serial's text below which a part is doubtful; one in another layout has hardly more
    # than 0.1
    doubtful: float = 0.4,
    # share of the greatest promise from which a line that keeps to a format is in no other layout: of 156 plates that
    # were turned, mirrored, or struck in columns or two lines, those in which one was found had 0.35 at most
    fits: float = 0.5,
    # number of characters without a format below which they may be a piece of a column
    least_places: int = 4,
) -> Layout | None:
    """Find another layout in which a doubtful part reads well."""
    grammar = search.request.grammar
    if main is not None and main.is_text:
        choice = choose(main.lattice, grammar, k=1)
        sure = bool(choice.text) and choice.probability * main.count_probability >= doubtful
        if sure and (grammar is not None or len(choice.text) >= least_places):
            return None
        if grammar is not None and share_of(main) >= fits:
            return None
    lines: list[TextLine] = []
    for line in (
        *search.candidates()[:1],
        *(() if main is None else (main.line,)),
        *candidates,
        *search.candidates(),
    ):
        if not any(is_same_place(line, other) for other in lines):
            lines.append(line)
    return next(_layouts(search, main, lines), None)


def _layouts(
    search: Search, main: ReadLine | None, lines: Sequence[TextLine], *, least_gain_nats: float = 2.0
) -> Iterator[Layout]:
    limits, grammar = search.request.limits, search.request.grammar
    least = least_gain_nats + (0.0 if main is None else promise_of(main))

    def text_of(read: Sequence[ReadLine]) -> str:
        reads_well = is_convincing(read, limits.sure) and promise_of(read[0]) > least
        return choose(read[0].lattice, grammar, k=1).text if reads_well else ""

    other_way = search.read([line.reversed for line in lines[:2]], cheap=True)
    if text := text_of(other_way):
        yield Layout(LayoutKind.UPSIDE_DOWN, (text,), other_way[0].line)
    mirror = search.on(search.view.mirrored)
    there = [line_in_view(line, search.view, Way.ROWS_REVERSED) for line in lines[:2]]
    if text := text_of(mirror.read([*there, *(line.reversed for line in there)], cheap=True)):
        yield Layout(LayoutKind.MIRRORED, (text,))
    lengths = () if grammar is None else sorted(grammar.lengths() or ())[:3]
    vertical = search.turned_candidates(90.0)[:1]
    for line, places in [*((line, lengths) for line in (*lines, *vertical)), *_columns(lines)]:
        laid = _laid_side_by_side(search.view, line, places)
        columns = (search.on(view).read(rows, cheap=True) for view, rows in laid)
        best = max(columns, key=lambda read: promise_of(read[0]) if read else -math.inf, default=[])
        if text := text_of(best):
            yield Layout(LayoutKind.COLUMN, (text,))
    yield from _two_lines(search, lines)


def _columns(
    pieces: Sequence[TextLine], *, least_pieces: int = 3, aligned: float = 0.6
) -> list[tuple[TextLine, tuple[int, ...]]]:
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
    search: Search,
    lines: Sequence[TextLine],
    *,
    least_step: float = 0.8,
    alike: float = 1.6,
    clear: float = 0.8,
) -> Iterator[Layout]:
    grammar = search.request.grammar
    if grammar is None:
        return
    clearly = [
        (read.line, open_places.text)
        for read in search.under(None).read(lines, cheap=True)
        if (open_places := read.open_places[0]).n_places
        and float(np.exp(open_places.log_belief.max(axis=1)).mean()) >= clear
    ]
    for (upper, first), (lower, second) in permutations(clearly, 2):
        heights = sorted((upper.height_mm, lower.height_mm))
        step_mm = float((lower.centre_mm.mean(axis=0) - upper.centre_mm.mean(axis=0))[1])
        apart = step_mm >= least_step * heights[1] and heights[1] <= alike * heights[0]
        if apart and not grammar.objections(first + second):
            yield Layout(LayoutKind.TWO_LINES, (first, second))


def _laid_side_by_side(
    view: View, line: TextLine, lengths: Sequence[int], *, usual_gap: float = 0.35
) -> Iterator[tuple[View, list[TextLine]]]:
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
    surface = band[HEIGHTS] if band[HEIGHTS].any() else band[GREY]
    slope = np.hypot(*np.gradient(surface)) * band[KNOWN]
    ink = np.minimum(slope, np.percentile(slope, 98.0)).mean(axis=1)
    land, inked = np.percentile(ink, (5.0, 75.0))
    reach = max(1, round(closed * band.shape[2]))
    rows = ndimage.binary_closing(np.pad(ink > land + least_ink * (inked - land), reach), iterations=reach)
    labels, _ = ndimage.label(rows[reach:-reach])
    stretches = [(stretch[0].start, stretch[0].stop) for stretch in ndimage.find_objects(labels)]
    return [(first, last) for first, last in stretches if last - first > 2 * reach]
