"""Find lines of any size in a large photograph, where they may fill a twentieth of its width.

    picture --at several scales--> tiles that are like text, and all of a coarse one --finder--> lines
    lines --a cheap look at each--> text, most promising first

Where a row of strokes lies on calmer land, upright edges are denser than above and below. A fine scale without such
rows costs hardly any time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recognition.find.finder import CELL, FINDER_ROWS, FoundLine, findings, joined_cells, without_doubles
from recognition.find.promise import promise_of
from recognition.find.search import Search
from recognition.find.tiles import COLUMNS, LEAST_PIXELS, ROWS, even_out
from recognition.recogniser.read_line import ReadLine
from recognition.see.view import GREY, KNOWN, LAYERS, View

Floats = NDArray[np.float32]
Corners = list[tuple[int, int]]


def read_wide(search: Search, *, most_lines: int = 10) -> list[ReadLine]:
    """Lines of a large picture that are text by a cheap look, most promising first."""
    lines = find_wide(search.view, height_mm=search.request.height_mm)[:most_lines]
    read = search.in_region(search.read((candidate.line for candidate in lines), cheap=True))
    return sorted((line for line in read if line.is_text), key=promise_of, reverse=True)


def find_wide(
    view: View,
    *,
    height_mm: float | None = None,
    tallest: float = 0.45,
    lowest: float = 0.0085,
    octaves: float = 0.7,
    coarse_pixels: int = 130_000,
    most_rows: int = 24,
) -> list[FoundLine]:
    """Find the lines of a large picture, most promising first; they run within some 30 degrees of level."""
    from glyphs.opencv import cv2

    side, lines, grey = min(view.size_mm), list[FoundLine](), view.layers[GREY]
    least_mm = max(lowest * side, LEAST_PIXELS * view.pitch_mm)
    count = int(np.log2(tallest * side / least_mm) / octaves) + 1
    scales_mm = [tallest * side * 2.0 ** (-octaves * k) for k in range(count)]
    for scale_mm in scales_mm if height_mm is None else [height_mm]:
        columns = max(8, round(grey.shape[1] * view.pitch_mm * FINDER_ROWS / scale_mm))
        rows = max(8, round(grey.shape[0] * columns / grey.shape[1]))
        how = cv2.INTER_AREA if columns < grey.shape[1] else cv2.INTER_LINEAR
        picture = np.asarray(cv2.resize(grey, (columns, rows), interpolation=how), dtype=np.float32)
        corners = [(y - ROWS // 2, x - COLUMNS // 2) for y, x in _text_like(picture)[:most_rows]]
        lines += _lines_of(picture, corners, (ROWS, COLUMNS), view)
        if picture.size <= coarse_pixels:
            whole = (-(-rows // CELL) * CELL, -(-columns // CELL) * CELL)
            lines += _lines_of(picture, [(0, 0)], whole, view)
    return without_doubles(lines)


def _lines_of(
    picture: Floats, corners: Corners, tile: tuple[int, int], view: View, *, least: float = 0.5
) -> Iterator[FoundLine]:
    if not corners:
        return
    pitch_mm = view.pitch_mm * view.layers.shape[2] / picture.shape[1]
    first_mm = [origin + 0.5 * (pitch_mm - view.pitch_mm) for origin in view.origin_mm]
    layers = np.zeros((len(corners), LAYERS, *tile), dtype=np.float32)
    padding = [(size, size) for size in tile]
    padded, known = np.pad(picture, padding, mode="edge"), np.pad(np.ones_like(picture), padding)
    for each, (y, x) in zip(layers, corners, strict=True):
        window = slice(y + tile[0], y + 2 * tile[0]), slice(x + tile[1], x + 2 * tile[1])
        each[KNOWN] = known[window]
        each[GREY] = even_out(padded[window]) * each[KNOWN]
    for (y, x), cells in zip(corners, findings(layers), strict=True):
        origin_mm = (first_mm[0] + x * pitch_mm, first_mm[1] + y * pitch_mm)
        yield from joined_cells(cells, pitch_mm, origin_mm, least=least)


def _text_like(
    picture: Floats,  # (rows, columns) brightness, 12 pixels for each character height
    *,
    cell: int = 4,
    strongest: float = 0.4,
    # ratio of the edges of a place and those above and below from which it counts no more: a single edge is
    # not a row
    most_denser: float = 2.5,
    least_denser: float = 1.2,
) -> Corners:
    """Row and column of the middles of rows of upright edges, the densest first."""
    from glyphs.opencv import cv2

    rows, columns = (max(n // cell, 1) for n in picture.shape)
    steep = np.minimum(np.abs(cv2.Sobel(picture, cv2.CV_32F, 1, 0, ksize=3)), strongest)
    steep = cv2.resize(steep, (columns, rows), interpolation=cv2.INTER_AREA)
    # a character is 3 cells high, and a row is five of them long
    height, length = 3, 15
    here, row = cv2.boxFilter(steep, -1, (height, height)), cv2.boxFilter(steep, -1, (length, height - 1))
    beside = cv2.copyMakeBorder(row, height + 1, height + 1, 0, 0, cv2.BORDER_REPLICATE)
    beside = 0.5 * (beside[: -2 * (height + 1)] + beside[2 * (height + 1) :])
    denser = np.minimum(here / (beside + float(np.median(here)) + 1e-4), most_denser)
    mean = cv2.boxFilter(denser, -1, (length, 1))
    peak = cv2.dilate(mean, np.ones((height, length), dtype=np.uint8))
    y, x = np.nonzero((mean >= peak) & (mean > least_denser))
    order = np.argsort(-mean[y, x], kind="stable")
    return [(cell * int(y[k]) + cell // 2, cell * int(x[k]) + cell // 2) for k in order]
