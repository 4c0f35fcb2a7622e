"""Read by correlation: compare a felt line with a font's templates, without a network.

    strip --normalised correlation--> responses of every template --best chain--> places
    places --every template in every place's cell--> correlations --softmax--> Steps

The correlation of a template t with the window w of the edge map around a pixel, both about their means, is

    r = sum(t w) / sqrt(sum(t^2) (sum(w^2) + (least_felt^2) sum(t^2)))

so that it is about 0 on bare land.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax

from glyphs.fonts.glyph import Font
from recognition.glyph_match.chain import Placed, best_chain, usual_spacing
from recognition.glyph_match.predicted import PIXELS, TemplateSet
from recognition.language.grammar import Grammar
from recognition.recogniser.steps import Steps
from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.see.view import EDGES, KNOWN, View

Image: TypeAlias = NDArray[np.float32]
SMOOTH = 0.4
"""Standard deviation of the smoothing of felt and predicted maps before they are sampled, pixels."""


@dataclass(frozen=True, eq=False)
class GlyphImages:
    """The templates of a font at a number of pixels per character height."""

    chars: tuple[str, ...]
    # (T,) images (rows, columns, layers), of odd size, with the glyph's reference point in the middle
    images: tuple[Image, ...]
    half_cols: NDArray[np.int64]
    pixels: int


def image_of(view: View, line: TextLine, *, rows: float, margin: float, pixels: int) -> Image:
    """(rows, columns, layers) image of the edges felt along a line, straightened."""
    from glyphs.opencv import cv2

    strip = view.strip(line, rows=rows, margin=margin, zoom=pixels / HEIGHT_ROWS)
    image = np.ascontiguousarray(strip[EDGES:KNOWN].transpose(1, 2, 0))
    return np.asarray(cv2.GaussianBlur(image, (0, 0), SMOOTH), dtype=np.float32)


def glyph_images(templates: TemplateSet, *, pixels: int, margin_heights: float = 0.12) -> GlyphImages:
    """The templates at a number of pixels per character height, with land beside their ink; cached in the set."""
    images: GlyphImages = templates.derive(
        ("correlation", pixels, margin_heights), lambda: _glyph_images(templates, pixels, margin_heights)
    )
    return images


def _glyph_images(templates: TemplateSet, pixels: int, margin_heights: float) -> GlyphImages:
    from glyphs.opencv import cv2

    ratio = PIXELS / pixels
    middle_row, middle_col = (n // 2 for n in templates.patches.shape[2:])
    high = int(middle_row / ratio)
    images: list[Image] = []
    for patch, half in zip(templates.patches, templates.half_width, strict=True):
        wide = min(int(middle_col / ratio), math.ceil((half + margin_heights) * pixels))
        x, y = np.meshgrid(
            np.arange(-wide, wide + 1) * ratio + middle_col, np.arange(-high, high + 1) * ratio + middle_row
        )
        smooth = cv2.GaussianBlur(np.ascontiguousarray(patch.transpose(1, 2, 0)), (0, 0), SMOOTH * ratio)
        sampled = cv2.remap(smooth, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        images.append(np.asarray(sampled, dtype=np.float32))
    half_cols = np.maximum(1, np.rint(templates.half_width * pixels)).astype(np.int64)
    return GlyphImages(templates.chars, tuple(images), half_cols, pixels)


def responses(image: Image, glyphs: GlyphImages, *, rows: slice) -> Image:
    """(T, rows, columns) correlation of every template centred at every pixel of some rows of an image."""
    up, side = (max(template.shape[k] // 2 for template in glyphs.images) for k in (0, 1))
    padded = np.pad(image, ((up, up), (side, side), (0, 0)))[rows.start : rows.stop + 2 * up]
    correlations = np.empty((len(glyphs.images), rows.stop - rows.start, image.shape[1]), dtype=np.float32)
    for high, wide in {(template.shape[0] // 2, template.shape[1] // 2) for template in glyphs.images}:
        window = padded[up - high : len(padded) - up + high, side - wide : padded.shape[1] - side + wide]
        alike = [k for k, template in enumerate(glyphs.images) if template.shape[1] == 2 * wide + 1]
        correlations[alike] = correlate(window, [glyphs.images[k] for k in alike])
    return correlations


def correlate(
    image: Image,
    templates: Sequence[Image],
    *,
    least_felt: float = 0.1,  # share of a template's amplitude below which a felt pattern counts as land
) -> Image:
    """(T, rows, columns) normalised correlation of templates of one size at all positions within an image."""
    from glyphs.opencv import cv2

    # layers that are zero everywhere, such as directions that were not felt, are left out of both
    known = np.flatnonzero(np.abs(image).max(axis=(0, 1)))
    if not known.size:
        known = np.arange(1)
    image = np.ascontiguousarray(image[..., known])
    energy = _energy(image, *templates[0].shape[:2])
    correlations = np.empty((len(templates), *energy.shape), dtype=np.float32)
    for correlation, image_of_template in zip(correlations, templates, strict=True):
        template = np.ascontiguousarray((image_of_template - image_of_template.mean(axis=(0, 1)))[..., known])
        size = float(np.vdot(template, template)) + 1e-9  # above 0 where a template predicts nothing
        product = cv2.matchTemplate(image, template, cv2.TM_CCORR)
        correlation[:] = product / np.sqrt(size * (energy + least_felt**2 * size))
    return correlations


def _energy(image: Image, rows: int, columns: int) -> NDArray[np.float64]:
    from glyphs.opencv import cv2

    def sums(values: Image) -> NDArray[np.float64]:
        table = cv2.integral(np.ascontiguousarray(values))
        return np.asarray(
            table[rows:, columns:]
            - table[:-rows, columns:]
            - table[rows:, :-columns]
            + table[:-rows, :-columns]
        )

    total = sums((image**2).sum(axis=2))
    means = sum(sums(image[..., k]) ** 2 for k in range(image.shape[2])) / (rows * columns)
    return np.maximum(total - means, 0.0)


def chain_of(
    response: Image,
    glyphs: GlyphImages,
    font: Font,
    grammar: Grammar | None,
    *,
    chance: float = 0.45,  # correlation up to which a template explains nothing, because any strokes reach it
    overlap_heights: float = 0.08,
    gap_heights: float = 1.5,
    free_gap_heights: float = 0.5,
    # cost of each further character height of land; a clean character of usual width has reward 1
    gap_cost: float = 0.25,
) -> tuple[float, tuple[Placed, ...]]:
    """The chain of characters that explains most of a line, with its total reward."""
    pixels = glyphs.pixels
    share = np.clip(response, 0.0, 1.0) ** 2 - chance**2
    full = glyphs.half_cols.astype(np.float64) * (1.0 - chance**2)
    usual = float(np.median(full))
    places, allowed = None if grammar is None else grammar.fixed_places, None
    if places is not None:
        allowed = np.array([[char in place for char in glyphs.chars] for place in places], dtype=np.bool_)
    best = partial(
        best_chain,
        (glyphs.half_cols[:, None] / usual * share).astype(np.float32),
        glyphs.half_cols,
        allowed=allowed,
        overlap=round(overlap_heights * pixels),
        reach=round(gap_heights * pixels),
        gap_free=round(free_gap_heights * pixels),
        gap_cost=gap_cost / pixels,
    )
    total, placed = best()
    if grammar is None or places is None or not placed:
        return total, placed
    # searched again with the spacing of the most certain characters
    spacing = usual_spacing(placed, glyphs.chars, font, full=full / usual, gaps=grammar.gaps, pixels=pixels)
    return (total, placed) if spacing is None else best(spacing=spacing)


def beside(
    response: Image, glyphs: GlyphImages, font: Font, placed: Sequence[Placed], *, surely: float = 0.65
) -> tuple[Placed, ...]:
    """The characters of a chain, and certain ones in line beside them, left to right."""
    free = np.where(response > surely, response, 0.0)
    columns = np.arange(response.shape[1])
    for char in placed:
        room = glyphs.half_cols + glyphs.half_cols[char.template]
        free[np.abs(columns - char.column) < room[:, None]] = 0.0
    _, others = chain_of(free, glyphs, font, None)
    return tuple(sorted((*placed, *others), key=lambda char: char.column))


def cell_correlations(
    image: Image,
    glyphs: GlyphImages,
    *,
    row: int,
    column: int,
    bounds: tuple[int, int],
    shift_heights: float = 0.1,
    across_heights: float = 0.2,
) -> NDArray[np.float64]:
    """(T,) best correlation of every template with one cell of an image over small shifts."""
    shift = round(shift_heights * glyphs.pixels)
    high = max(template.shape[0] // 2 for template in glyphs.images)
    low, end = bounds
    pad = high + shift + 1
    side = round(across_heights * glyphs.pixels)
    padded = np.pad(image, ((pad, pad), (side, side), (0, 0)))
    window = padded[row + pad - high - shift : row + pad + high + shift + 1, low : end + 2 * side]
    cells = np.zeros((len(glyphs.images), 2 * high + 1, end - low, image.shape[2]), dtype=np.float32)
    for cell, template in zip(cells, glyphs.images, strict=True):
        tall, first = template.shape[0] // 2, column - low - template.shape[1] // 2
        seen = template[:, max(0, -first) : max(0, min(template.shape[1], end - low - first))]
        cell[high - tall : high + tall + 1, max(0, first) : max(0, first) + seen.shape[1]] = seen
    return np.asarray(correlate(window, list(cells)).max(axis=(1, 2)), dtype=np.float64)


def steps_of(
    cells: NDArray[np.float64],
    known: Sequence[str],
    columns: NDArray[np.float64],
    *,
    chars: str,
    rare: str = "",
    # log odds per unit of -log(1 - r^2) / 2; the most likely of values from 4 to 30, on 672 places of gothic,
    # futuram, timesr, DejaVu Sans, Roboto Bold and Lato with dirt 0, 0.3 and 0.6
    sureness: float = 30.0,
    # best correlation at which a place has a readable character with probability 0.5. Of the same places, 655
    # of 656 with at least 0.5 are right, and 12 of 15 with 0.3 to 0.5.
    read_from: float = 0.4,
    read_width: float = 0.04,
) -> Steps:
    """Posteriors along a line: a step at every place, and a blank one before, between and after."""
    score = -0.5 * np.log(1.0 - np.clip(cells, 0.0, 0.999) ** 2)
    shares = softmax(sureness * score, axis=1)
    read = expit((cells.max(axis=1) - read_from) / read_width)
    places, odd = len(cells), slice(1, None, 2)
    blank, of = np.ones(2 * places + 1), np.zeros((2 * places + 1, len(chars)))
    blank[odd] = 1.0 - read
    for k, char in enumerate(known):
        if char in chars:
            of[odd, chars.index(char)] = read * shares[:, k]
    between = np.r_[columns[0] - HEIGHT_ROWS, 0.5 * (columns[:-1] + columns[1:]), columns[-1] + HEIGHT_ROWS]
    along = np.empty(2 * places + 1)
    along[odd], along[::2] = columns, between
    return Steps.of(blank, of, chars, along, rare=rare, expert="templates")
