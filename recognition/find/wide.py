"""Find lines of any size in a large photograph, where they may fill a twentieth of its width.

picture --at several scales--> tiles that are like text, and all of a coarse one --finder--> lines
lines --a cheap look at each--> text, most promising first
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recognition.find.finder import CELL, FINDER_ROWS, FoundLine, findings, joined_cells, without_doubles
from recognition.find.promise import promise_of
from recognition.find.search import Search
from recognition.find.tiles import COLUMNS, ROWS, Corners, even_out, text_like, text_scales_mm
from recognition.recogniser.read_line import ReadLine
from recognition.see.view import GREY, KNOWN, LAYERS, View

Floats = NDArray[np.float32]


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
    coarse_pixels: int = 130_000,
    most_rows: int = 24,
) -> list[FoundLine]:
    """Find the lines of a large picture, most promising first; they run within some 30 degrees of level."""
    from glyphs.opencv import cv2

    lines, grey = list[FoundLine](), view.layers[GREY]
    scales_mm = text_scales_mm(view, tallest=tallest, lowest=lowest) if height_mm is None else [height_mm]
    for scale_mm in scales_mm:
        columns = max(8, round(grey.shape[1] * view.pitch_mm * FINDER_ROWS / scale_mm))
        rows = max(8, round(grey.shape[0] * columns / grey.shape[1]))
        how = cv2.INTER_AREA if columns < grey.shape[1] else cv2.INTER_LINEAR
        picture = np.asarray(cv2.resize(grey, (columns, rows), interpolation=how), dtype=np.float32)
        corners = [(y - ROWS // 2, x - COLUMNS // 2) for y, x in text_like(picture)[:most_rows]]
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
