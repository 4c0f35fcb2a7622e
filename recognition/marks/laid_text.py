"""The characters of a text where a font's templates lie best: what their marks are graded and measured by.

strip of the felt line          a template about its place          moved to where they go together best
  |  K  7  B  |                       [  7  ]                             row, column, correlation
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from recognition.glyph_match.chain import Placed
from recognition.glyph_match.correlation import (
    GlyphImages,
    Image,
    cell_correlations,
    correlate,
    glyph_images,
    image_of,
)
from recognition.glyph_match.predicted import PIXELS, template_key
from recognition.glyph_match.spacing import place_bounds
from recognition.glyph_match.template_cache import TemplateCache
from recognition.marks.strokes import PlaceStrokes
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import View
from whisker_array.whisker.touch import Touch

MARGIN_HEIGHTS = 1.0
"""Margins of the strip along and across the line: room for a template at either end."""
OWN_FIT = 0.75
"""Mean correlation from which an unnamed font is taken for the part's."""
STRUCK_FIT = 0.7
"""Mean correlation with a flat die below which a dotted one is tried."""
MOST_SAG_HEIGHTS = 0.3
"""A line that bends more has each character turned otherwise than templates, which are straight."""


@dataclass(frozen=True, eq=False)
class LaidText:
    """A text in the templates of a font.

    Attributes:
        text: a character a place.
        font: whose templates.
        face: of its die.
        raised: whether the marks stand out.
        glyphs: templates of the font, felt as the part was, PIXELS to the height.
        line: along which the text stands.
        image: (rows, columns, layers) of the line.
        columns, rows: (places,) of the image, where each character's middle lies.
        fits: (places,) correlations of the characters with the image; 0 of those that the font has not got.
    """

    text: tuple[str, ...]
    font: Font
    face: Face
    raised: bool
    glyphs: GlyphImages
    line: TextLine
    image: Image
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    fits: NDArray[np.float64]

    @property
    def fit(self) -> float:
        """Mean correlation."""
        return float(self.fits.mean())

    @property
    def rotation_deg(self) -> float:
        """Rotation of the line through the middles of the characters."""
        if len(self.fits) < 2:
            return self.line.turned_deg
        return TextLine(self.places_mm(), self.line.height_mm).turned_deg

    def correlations(self) -> list[NDArray[np.float64]]:
        """Return for every place the (T,) best correlations of the font's templates with its cell."""
        known = self.glyphs.chars
        placed = [
            Placed(known.index(c) if c in known else 0, int(column), 0.0)
            for c, column in zip(self.text, self.columns, strict=True)
        ]
        bounds = place_bounds(placed, self.glyphs.half_cols, self.image.shape[1], pixels=PIXELS)
        return [
            cell_correlations(self.image, self.glyphs, row=int(row), column=one.column, bounds=bound)
            for one, row, bound in zip(placed, self.rows, bounds, strict=True)
        ]

    def places_mm(self, *, ahead_heights: float = 0.0) -> NDArray[np.float64]:
        """(places, 2) x, y of the characters' middles, or of points ahead of them."""
        u, v = ((at + 0.5) * HEIGHT_ROWS / PIXELS - 0.5 for at in (self.columns, self.rows))
        height = self.image.shape[0] * HEIGHT_ROWS / PIXELS
        return self.line.places_mm(u + ahead_heights * HEIGHT_ROWS, v, margin=MARGIN_HEIGHTS, of_rows=height)

    def turns_deg(self, *, ahead_heights: float = 0.1) -> NDArray[np.float64]:
        """(places,) direction of the line at each character, from so many character heights on either side."""
        along = self.places_mm(ahead_heights=ahead_heights) - self.places_mm(ahead_heights=-ahead_heights)
        return np.asarray(np.degrees(np.arctan2(along[:, 1], along[:, 0])))


def laid_text(
    view: View,
    touch: Touch,
    line: TextLine,
    columns: NDArray[np.float64],
    text: Sequence[str],
    fonts: Sequence[Font],
    *,
    cache: TemplateCache,
    chars: str,
    raised: bool | None,
    coarse_pixels: int = 20,
) -> LaidText | None:
    """The text in the font and the kind of die that suits it best; None where no font has any of its characters.

    Args:
        view: as felt.
        touch: how.
        line: along which the text stands.
        columns: (places,) of the line's strip.
        text: a character a place.
        fonts: to choose from.
        cache: of template sets.
        chars: characters that may occur.
        raised: whether the marks stand out; whatever fits better where that is not known.
        coarse_pixels: pixels to a character height for the choice of the font and of the line's height.
    """
    lay = partial(_lay, view, line, columns, text)

    def best(face: Face) -> LaidText | None:
        tried = []
        for font, out in product(fonts, (False, True) if raised is None else (raised,)):
            own = "".join(c for c in chars if c in font.glyphs)
            if not set(own) & set(text) or (face is Face.DOTTED and not font.stroke_ratio > 0.0):
                continue
            key = template_key(font, touch, height_mm=line.height_mm, raised=out, face=face)
            templates = cache.get(font, own, key)
            rough = glyph_images(templates, pixels=coarse_pixels)
            tried.append((*_fit_size(partial(lay, rough)), templates, font, out))
        if not tried:
            return None
        _, size, templates, font, out = max(tried, key=lambda one: one[0])
        glyphs = glyph_images(templates, pixels=PIXELS)
        return LaidText(tuple(text), font, face, out, glyphs, *lay(glyphs, size))

    flat = best(Face.FLAT)
    if flat is not None and flat.fit >= STRUCK_FIT:
        return flat
    either = [one for one in (flat, best(Face.DOTTED)) if one is not None]
    return max(either, key=lambda one: one.fit, default=None)


_Laid: TypeAlias = tuple[TextLine, Image, NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


def _fit_size(
    lay: Callable[[float], _Laid], *, size_step: float = 1.04, most_steps: int = 5
) -> tuple[float, float]:
    """The best mean correlation of a text over the heights of its line, and that height in units of the line's.

    Args:
        lay: lays the text at a height.
        size_step: factor between two heights; the next is tried while the text fits better.
        most_steps: most such steps either way: turned lines are found too high, by 16 % at 8 degrees.
    """

    def fit(size: float) -> float:
        return float(lay(size)[-1].mean())

    best = (fit(1.0), 1.0)
    for step in (1.0 / size_step, size_step):
        for k in range(1, most_steps + 1):
            other = (fit(step**k), step**k)
            if other <= best:
                break
            best = other
        if best[1] != 1.0:
            break
    return best


def _lay(
    view: View,
    line: TextLine,
    columns: NDArray[np.float64],
    text: Sequence[str],
    glyphs: GlyphImages,
    size: float,
    *,
    moved_heights: float = 0.15,
) -> _Laid:
    """The line of another size, its image, and columns, rows and correlations of the text's characters on it.

    Args:
        view, line, columns, text: as of `laid_text`.
        glyphs: templates of a font.
        size: height in units of the line's.
        moved_heights: search radius of a character about its place, character heights.
    """
    sized, pixels = TextLine(line.centre_mm, size * line.height_mm), glyphs.pixels
    high = (1.0 + 2.0 * MARGIN_HEIGHTS) * HEIGHT_ROWS
    image = image_of(view, sized, rows=high, margin=MARGIN_HEIGHTS, pixels=pixels)
    along = ((columns + 0.5) / HEIGHT_ROWS - MARGIN) / size + MARGIN_HEIGHTS
    at = np.rint(along * pixels - 0.5).astype(np.int64)
    rows, fits = np.full(at.size, image.shape[0] // 2), np.zeros(at.size)
    move, templates = round(moved_heights * pixels), dict(zip(glyphs.chars, glyphs.images, strict=True))
    for k, char in enumerate(text):
        if char not in templates:
            continue
        up, side = (n // 2 + move for n in templates[char].shape[:2])
        padded = np.pad(image, ((up, up), (side, side), (0, 0)))
        at[k] = min(max(at[k], 0), image.shape[1] - 1)
        window = padded[rows[k] : rows[k] + 2 * up + 1, at[k] : at[k] + 2 * side + 1]
        answer = correlate(window, [templates[char]])[0]
        down, aside = np.unravel_index(int(answer.argmax()), answer.shape)
        rows[k] += down - move
        at[k] += aside - move
        fits[k] = answer[down, aside]
    return sized, image, at, rows, fits


def suited_fonts(fonts: Sequence[Font], places: Sequence[PlaceStrokes]) -> tuple[Font, ...]:
    """Return the font whose strokes suit most places, of those that stand in for an unnamed one; all without any."""
    votes = Counter(place.font for place in places)
    best = max(fonts, key=lambda font: votes[font.name])
    return (best,) if votes[best.name] else tuple(fonts)
