"""Read by correlation: compare a felt line with a font's templates, without a network.

    strip --normalised correlation--> responses of every template --best chain--> places
    places --every template in every place's cell--> correlations --softmax--> Steps

The correlation of a template t with the window w of the edge map around a pixel, both about their means, is

    r = sum(t w) / sqrt(sum(t^2) (sum(w^2) + (least_felt^2) sum(t^2)))

so that it is about 0 on bare land.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft
from scipy.special import expit, softmax

from glyphs.fonts.glyph import Font
from recognition.glyph_match.chain import Placed, best_chain, usual_spacing
from recognition.glyph_match.predicted import PIXELS, TemplateSet
from recognition.language.grammar import Grammar
from recognition.recogniser.steps import Steps
from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.see.view import EDGES, KNOWN, View

Image: TypeAlias = NDArray[np.float32]
LEAST_FELT = 0.1
"""Share of a template's amplitude below which a felt pattern counts as land."""
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

    @cached_property
    def reach(self) -> tuple[int, int]:
        """Rows and columns of the largest template above and beside its middle; all have as many rows."""
        return self.images[0].shape[0] // 2, max(image.shape[1] // 2 for image in self.images)


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
    up, side = glyphs.reach
    padded = np.pad(image, ((up, up), (side, side), (0, 0)))[rows.start : rows.stop + 2 * up]
    felt = _felt_layers(padded)
    layers = np.ascontiguousarray(padded[..., felt].transpose(2, 0, 1))
    # in tiles of few sizes, so that all lines share the templates' spectra: 40 rows hold a line of 16 pixels
    tile = _doubled(40, min(layers.shape[1], 2.5 * up)), _doubled(8 * glyphs.pixels, 2.5 * side)
    spectra, sizes = _spectra(glyphs, tile)
    correlations = np.empty((len(glyphs.images), rows.stop - rows.start, image.shape[1]), dtype=np.float32)
    tall, wide = tile[0] - 2 * up, tile[1] - 2 * side
    for top, left in product(range(0, correlations.shape[1], tall), range(0, correlations.shape[2], wide)):
        filled = correlations[:, top : top + tall, left : left + wide]
        together = np.zeros(spectra.shape[1:], dtype=np.complex64)
        for layer, seen in zip(felt, layers[:, top : top + tile[0], left : left + tile[1]], strict=True):
            together += spectra[layer] * fft.rfft2(seen, s=tile)
        across = fft.ifft(together, axis=1, overwrite_x=True)[:, : filled.shape[1]]
        filled[:] = fft.irfft(across, n=tile[1])[..., : filled.shape[2]]
    sizes = sizes[felt].sum(axis=0)
    widths = np.array([template.shape[1] for template in glyphs.images])
    for width, energy in _energies(layers, 2 * up + 1, np.unique(widths)):
        first = side - width // 2
        energy = energy[:, first : first + image.shape[1]]
        for k in np.flatnonzero(widths == width):
            correlations[k] /= _norm(float(sizes[k]), energy)
    return correlations


@lru_cache(maxsize=12)  # those of one part, 3 to 12 MB each
def _spectra(
    glyphs: GlyphImages, shape: tuple[int, int]
) -> tuple[NDArray[np.complex64], NDArray[np.float64]]:
    """(layers, T, rows, columns) spectra of the templates about their means, and (layers, T) their energies."""
    up, side = glyphs.reach
    about_mean = [template - template.mean(axis=(0, 1)) for template in glyphs.images]
    padded = np.zeros((glyphs.images[0].shape[2], len(about_mean), *shape), dtype=np.float32)
    for k, template in enumerate(about_mean):
        first = side - template.shape[1] // 2
        padded[:, k, : 2 * up + 1, first : first + template.shape[1]] = template.transpose(2, 0, 1)
    energies = np.array([np.square(template, dtype=np.float64).sum(axis=(0, 1)) for template in about_mean])
    spectra = fft.rfft2(padded, overwrite_x=True)
    return np.conj(spectra, out=spectra), energies.T


def _energies(
    layers: Image, rows: int, widths: NDArray[np.int64]
) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Each width with the energy about the mean of all windows of so many rows and columns."""
    from glyphs.opencv import cv2

    tables = np.array([cv2.integral(layer) for layer in (*layers, np.square(layers).sum(axis=0))])
    tall = tables[:, rows:] - tables[:, :-rows]
    for width in widths.tolist():
        *sums, total = tall[..., width:] - tall[..., :-width]
        about_mean = total - sum(map(np.square, sums)) / (rows * width)
        yield width, np.maximum(about_mean, 0.0).astype(np.float32)


def _doubled(size: int, least: float) -> int:
    return size if size >= least else _doubled(2 * size, least)


def _felt_layers(image: Image) -> NDArray[np.intp]:
    """Layers that are not zero everywhere, such as directions that were not felt; at least one."""
    felt = np.flatnonzero(np.abs(image).max(axis=(0, 1)))
    return felt if felt.size else np.arange(1)


def _norm(size: float, energy: NDArray[np.float32], *, least_felt: float = LEAST_FELT) -> NDArray[np.float32]:
    size += 1e-9  # above 0 where a template predicts nothing
    return np.asarray(np.sqrt(size * (energy + least_felt**2 * size)))


def correlate(
    image: Image,
    templates: Sequence[Image],
    *,
    least_felt: float = LEAST_FELT,
) -> Image:
    """(T, rows, columns) normalised correlation of templates of one size at all positions within an image."""
    from glyphs.opencv import cv2

    known = _felt_layers(image)
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
    return np.asarray(_correlate_cells(window, cells).max(axis=(1, 2)), dtype=np.float64)


def _correlate_cells(image: Image, cells: Image) -> Image:
    """(T, rows, columns) as `correlate`, of templates that have few positions within the image."""
    felt = _felt_layers(image)
    layers = np.ascontiguousarray(image[..., felt].transpose(2, 0, 1))
    rows, columns = cells.shape[1:3]
    windows = sliding_window_view(layers, (rows, columns), axis=(1, 2)).transpose(1, 2, 0, 3, 4)
    about_mean = (cells - cells.mean(axis=(1, 2), keepdims=True))[..., felt].transpose(0, 3, 1, 2)
    templates = about_mean.reshape(len(cells), -1)
    products = windows.reshape(-1, templates.shape[1]) @ templates.T
    ((_, energy),) = _energies(layers, rows, np.array([columns]))
    sizes = np.square(templates, dtype=np.float64).sum(axis=1)
    norms = np.array([_norm(size, energy) for size in sizes.tolist()])
    return np.asarray(products.T.reshape(norms.shape) / norms)


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
