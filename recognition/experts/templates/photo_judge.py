"""The judge who knows shapes, of photographs: pictures of a named font under any light, along a line that others found.

    strip --edges--> products with every picture --a light, a spacing--> evidence --all settings summed--> PhotoFit
                                      ^------------------------------------'

The weights of the light that explain the line best, by least squares over its characters, hold for all of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recognition.experts.templates.photo_chain import Settled, gap_of, log_sum, settled
from recognition.experts.templates.photo_shapes import PICTURES, PhotoShapes, photo_edges
from recognition.language.lattice import Lattice
from recognition.lines.moves import moved
from recognition.views.curves import straight_through
from recognition.views.text_line import HEIGHT_ROWS, ROWS, TextLine
from recognition.views.view import GREY, KNOWN, View

Floats = NDArray[np.float64]
SCALES = (20, 28)
"""Pixels to a character's height at which a line is judged; it is placed at the first."""
MARGIN_HEIGHTS, BAND_HEIGHTS = 1.0, 1.9
"""Of the strip beside the line, and its rows: the line may have been found short, high or low."""
_FINE = 3
"""Pixels of the photograph's strip that are averaged for one of the pictures."""
_INDEPENDENCE = 86.0
"""Independent values a layer in a square of the character's height; clutter and blur of neighbours go together."""
_ROW_REACH, _OFF_ROWS = 0.11, 0.32
"""Character heights by which a character may leave the common line, and the line where it was found."""
AZIMUTHS, STARTS, ROUNDS = 8, 2, 2
"""Lamps all round that are tried, those followed up, and rounds of fitting the light."""
HEIGHTS, TURNS_DEG = (0.93, 1.0, 1.07), (-3.0, 3.0)
"""Of a line that was found, that are tried to place it."""
CLOSER = (0.97, 1.03)
"""Heights tried about the best."""
PLAIN_VALUE = 16.0
"""Log Bayes factor a character from which a line stands out plainly: no other turn is tried."""
_LEAST = math.log(1e-6)
"""Of a belief: nothing is ruled out by one scale."""
SIDE_HEIGHTS = 0.35
"""Of a character to either side of its middle."""


@dataclass(frozen=True, eq=False)
class PhotoFit:
    """A line as a font's pictures have it.

    Attributes:
        value: log Bayes factor of the line against none.
        line: as others found it.
        points_mm: (places, 2) where its characters stand.
        log_belief: (places, T) of the font's characters; what is missing of a row is the belief in none of them.
    """

    value: float
    line: TextLine
    points_mm: Floats
    log_belief: Floats

    @property
    def placed(self) -> TextLine:
        """The straight line through its characters."""
        side = SIDE_HEIGHTS * self.line.height_mm
        return TextLine(straight_through(self.points_mm, before=side, after=side), self.line.height_mm)


def allowed_of(shapes: PhotoShapes, lattice: Lattice) -> NDArray[np.bool_] | None:
    """(places, T) which of a font's characters may stand where; None where it has none for a place."""
    allowed = np.isfinite(lattice.log_belief[:, [lattice.chars.index(c) for c in shapes.chars]])
    return allowed if allowed.size and allowed.any(axis=1).all() else None


def fitted(
    view: View, shapes: PhotoShapes, line: TextLine, allowed: NDArray[np.bool_], gaps: frozenset[int]
) -> PhotoFit | None:
    """What a font's pictures make of a line; None where it has no room.

    Args:
        view: a photograph.
        shapes: of the font.
        line: where the characters stand.
        allowed: (places, T) which characters may stand where.
        gaps: places of the format before a word gap.
    """
    products = _products(_edges(view, line, shapes.pixels), shapes)
    found = [
        one
        for light, row in _starts(products, shapes)
        if (one := _followed(products, shapes, light, row, allowed, gaps)) is not None
    ]
    if not found:
        return None
    best, trust, columns, rows = max(found, key=lambda one: one[0].log_evidence)
    zoom = HEIGHT_ROWS / shapes.pixels
    points = line.places_mm(
        (columns.astype(np.float64) + 0.5) * zoom - 0.5,
        (rows - products.shape[2] // 2) * zoom + 0.5 * (ROWS - 1),
        margin=MARGIN_HEIGHTS,
    )
    return PhotoFit(
        best.log_evidence, line, points, best.log_belief + np.log(np.maximum(trust, 1e-12))[:, None]
    )


def judged_photo(
    view: View, scales: Sequence[PhotoShapes], line: TextLine, lattice: Lattice, gaps: frozenset[int]
) -> tuple[float, Lattice] | None:
    """How well a font's pictures explain a line, and what they believe: the mean of the scales' logarithms.

    Args:
        view: a photograph.
        scales: of one font.
        line: where the characters stand.
        lattice: what others believe of it: places, and what may stand there.
        gaps: places of the format before a word gap.

    Returns:
        Both; None where the line has no room, or the font none of the characters.
    """
    allowed = allowed_of(scales[0], lattice)
    if allowed is None:
        return None
    fits = [fit for shapes in scales if (fit := fitted(view, shapes, line, allowed, gaps)) is not None]
    if not fits:
        return None
    own = np.mean([np.maximum(fit.log_belief, _LEAST) for fit in fits], axis=0)
    log = np.full(lattice.log_belief.shape, -np.inf)
    log[:, [lattice.chars.index(c) for c in scales[0].chars]] = np.where(allowed, own, -np.inf)
    # of what the font has not got it says nothing: as likely as its least likely one
    lacking = ~np.isfinite(log) & np.isfinite(lattice.log_belief)
    log = np.where(lacking, np.where(np.isfinite(log), log, np.inf).min(axis=1, keepdims=True), log)
    log -= np.maximum(np.logaddexp.reduce(log, axis=1), 0.0)[:, None]
    return sum(fit.value for fit in fits), replace(lattice, log_belief=np.minimum(log, 0.0))


def placed(
    view: View,
    shapes: PhotoShapes,
    lines: Sequence[TextLine],
    allowed: NDArray[np.bool_],
    gaps: frozenset[int],
    *,
    height_mm: float | None = None,
) -> PhotoFit | None:
    """The best of lines that others found, moved, turned and as high as the font's pictures have it.

    Args:
        view: a photograph.
        shapes: of the font, at a coarse scale.
        lines: to choose from.
        allowed: (places, T) which characters may stand where.
        gaps: places of the format before a word gap.
        height_mm: of the characters, if known.
    """

    def best_of(tried: Sequence[TextLine], *others: PhotoFit | None) -> PhotoFit | None:
        fits = [*others, *(fitted(view, shapes, line, allowed, gaps) for line in tried)]
        return max((fit for fit in fits if fit is not None), key=lambda fit: fit.value, default=None)

    high = [
        moved(line, 0.0, size)
        for line in lines
        for size in (HEIGHTS if height_mm is None else (height_mm / line.height_mm,))
    ]
    best = best_of(high)
    if best is not None and best.value < PLAIN_VALUE * len(allowed):
        best = best_of([moved(line, 0.0, 1.0, turn) for line in high for turn in TURNS_DEG], best)
    if best is not None:
        best = best_of([best.placed], best)
    if best is not None:
        best = best_of([moved(best.placed, 0.0, size) for size in CLOSER], best)
    return best


def _edges(view: View, line: TextLine, pixels: int) -> NDArray[np.float32]:
    from glyphs.opencv import cv2

    zoom = _FINE * pixels / HEIGHT_ROWS
    strip = view.strip(line, rows=BAND_HEIGHTS * HEIGHT_ROWS, margin=MARGIN_HEIGHTS, zoom=zoom)
    size = (strip.shape[2] // _FINE, strip.shape[1] // _FINE)
    grey, known = (cv2.resize(strip[k], size, interpolation=cv2.INTER_AREA) for k in (GREY, KNOWN))
    return photo_edges(np.asarray(grey), np.asarray(known > 0.99), pixels=pixels)


def _products(edges: NDArray[np.float32], shapes: PhotoShapes) -> NDArray[np.float32]:
    """(3, T, rows, cols) products of the edges with every picture, at the rows about the middle.

    Along the columns by their spectra, along the rows by matrix products, one for each frequency.
    """
    from scipy import fft

    count, pictures, layers, tall, wide = shapes.patches.shape
    _, rows, cols = edges.shape
    length = fft.next_fast_len(cols + wide, real=True)
    half = _rows(_OFF_ROWS, shapes) + _rows(_ROW_REACH, shapes)
    first, n = rows // 2 - half - tall // 2, 2 * half + 1
    seen = np.zeros((layers, n + tall - 1, cols), dtype=np.float32)
    low, high = max(0, first), min(rows, first + n + tall - 1)
    seen[:, low - first : high - first] = edges[:, low:high]
    flat = np.conj(fft.rfft(shapes.patches, length)).transpose(4, 1, 0, 2, 3)
    flat = np.ascontiguousarray(flat).reshape(-1, pictures * count, layers * tall)
    over = np.ascontiguousarray(fft.rfft(seen, length).transpose(2, 0, 1))
    windows = np.lib.stride_tricks.sliding_window_view(over, n, axis=2).reshape(over.shape[0], -1, n)
    found = fft.irfft(flat @ windows, length, axis=0)
    # column 0 of a product is a picture that starts there: its middle lies half its width on
    found = np.roll(found, wide // 2, axis=0)[:cols].astype(np.float32)
    return np.ascontiguousarray(found.reshape(cols, pictures, count, n).transpose(1, 2, 3, 0))


def _rows(heights: float, shapes: PhotoShapes) -> int:
    return max(1, round(heights * shapes.pixels))


def _starts(products: NDArray[np.float32], shapes: PhotoShapes) -> list[tuple[Floats, int]]:
    """Lights and rows that promise most."""
    around = np.arange(AZIMUTHS) * 2.0 * math.pi / AZIMUTHS
    lights = [np.array([math.cos(a), math.sin(a), 0.0]) for a in around]
    lights += [np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])]
    reach = _rows(_ROW_REACH, shapes)
    found = []
    for light in lights:
        size = np.sqrt(shapes.gram @ light @ light)
        lit = np.einsum("b,btrx->trx", light.astype(np.float32), products)
        lit /= size[:, None, None].astype(np.float32)
        promise = (np.maximum(lit.max(axis=0), 0.0) ** 2).mean(axis=1)
        pooled = np.convolve(promise, np.ones(2 * reach + 1), mode="valid")
        found.append((float(pooled.max()), light, int(pooled.argmax()) + reach))
    found.sort(key=lambda one: -one[0])
    return [(light, row) for _, light, row in found[:STARTS]]


def _followed(
    products: NDArray[np.float32],
    shapes: PhotoShapes,
    light: Floats,
    row: int,
    allowed: NDArray[np.bool_],
    gaps: frozenset[int],
) -> tuple[Settled, Floats, NDArray[np.intp], NDArray[np.intp]] | None:
    """The line about one row, its light and spacing fitted to it in turns.

    Returns:
        The line; how far anything stands at its places, their columns and rows.
    """
    reach = _rows(_ROW_REACH, shapes)
    near = products[:, :, row - reach : row + reach + 1].astype(np.float64)
    independence = _INDEPENDENCE / shapes.pixels**2
    gap: float | None = None
    found: Settled | None = None
    for turn in range(ROUNDS + 1):
        power = shapes.gram @ light @ light
        lit = np.einsum("b,btrx->trx", light, near)
        if turn == 0:
            # the strength is not known: the best one for every character by itself
            score = 0.5 * independence * np.maximum(lit, 0.0) ** 2 / power[:, None, None]
        else:
            score = independence * (lit - 0.5 * power[:, None, None])
        evidence = log_sum(score, 1) - math.log(score.shape[1])
        found = settled(evidence, shapes, allowed, gap=gap, word_gaps=gaps)
        if found is None:
            return None
        which = found.log_belief.argmax(axis=1)
        columns = found.column[np.arange(which.size), which]
        rows = score[which, :, columns].argmax(axis=1)
        seen = near[:, which, rows, columns].sum(axis=1)
        light = np.linalg.solve(shapes.gram[which].sum(axis=0) + np.eye(PICTURES), seen)
        gap = gap_of(shapes, which, columns, gaps)
    assert found is not None
    odds = np.clip(evidence[which, columns] - math.log(len(shapes.chars)), -50.0, 50.0)
    return found, 1.0 / (1.0 + np.exp(-odds)), columns, rows + row - reach
