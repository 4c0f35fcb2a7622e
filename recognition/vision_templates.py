"""Templates predicted for sight: what the ideal die's relief does to brightness, whatever the light.

A distant lamp brightens a wall by its slope towards it: brightness ~ l . grad h, with the azimuth of l unknown.
Dirt, paint or shadow in a groove makes the stroke itself darker or brighter: brightness ~ h. So every character
has three pictures, and a line of characters one weight for each of them::

    dh/dx: lit along x      dh/dy: lit along y      h: filled strokes
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph
from glyphs.stamping.die import Die, Face, default_die, die_glyph, shape_relief_mm
from recognition.templates import TemplateSet
from recognition.vision_edges import SCALE_HEIGHTS, derivatives

RIM_HEIGHTS = 0.16
"""Land around the ink in a template, character heights."""
FOCUS_HEIGHTS = 0.02
"""Blur of a camera that is about in focus, character heights."""
_FINE = 4
_NOMINAL_MM = 5.0


@dataclass(frozen=True)
class Look:
    """How closely templates and photograph are compared.

    Attributes:
        pixels: to the character height.
        scale_heights: scale of the derivative, character heights.
        independence: independent values a pixel and layer; clutter and blur of neighbours go together.
    """

    pixels: int
    scale_heights: float
    independence: float


GLANCE = Look(pixels=20, scale_heights=0.03, independence=0.25)
"""For finding the line."""
CLOSE_LOOK = Look(pixels=28, scale_heights=SCALE_HEIGHTS, independence=0.11)
"""For reading it: finer edges are the relief's, coarser ones the dirt's."""


@dataclass(frozen=True, eq=False)
class VisionBasis:
    """The three edge pictures of every character of a font.

    Attributes:
        font: its name.
        look: pixels and scale.
        chars: (T,) characters.
        patches: (T, 3, 2, rows, cols) float32: lit along x, lit along y, filled; derivatives along columns and
            rows. Rows and cols odd; the middle pixel is the middle of the ink's width at half the height.
        gram: (T, 3, 3) products of a character's pictures with each other.
        half_width: (T,) half the ink's width, character heights.
        middle: (T,) from the character's origin to the middle of its ink, character heights.
        advance: (T,) from its origin to the next one's, character heights.
        work: place for what matching derives, kept as long as the basis.
    """

    font: str
    look: Look
    chars: tuple[str, ...]
    patches: NDArray[np.float32]
    gram: NDArray[np.float64]
    half_width: NDArray[np.float64]
    middle: NDArray[np.float64]
    advance: NDArray[np.float64]
    work: dict[object, object] = field(default_factory=dict)

    def templates(self, weights: NDArray[np.float64]) -> TemplateSet:
        """The characters in one light, as the templates of touch are: (T, 2, rows, cols)."""
        lit = np.einsum("tbdrc,b->tdrc", self.patches, weights.astype(np.float32))
        return TemplateSet(self.font, self.chars, np.ascontiguousarray(lit), self.half_width)


def predict_basis(font: Font, chars: str, *, look: Look = CLOSE_LOOK, face: Face = Face.FLAT) -> VisionBasis:
    """Draw the pictures of a font's characters.

    Raises:
        FontError: a character that the font has not got.
        StampError: a die that cannot be.
    """
    height = _NOMINAL_MM
    die = default_die(height, font=font, face=face)
    shapes = [die_glyph(font.glyph(c), die, height_mm=height) for c in chars]
    boxes = np.array([shape.ink_box for shape in shapes])
    half = 0.5 * (boxes[:, 2] - boxes[:, 0])
    middle = 0.5 * (boxes[:, 2] + boxes[:, 0])
    tall = float(max(boxes[:, 3].max() - 0.5, 0.5 - boxes[:, 1].min())) + RIM_HEIGHTS
    wide = float(half.max()) + RIM_HEIGHTS
    rows, cols = (2 * math.ceil(extent * look.pixels) + 1 for extent in (tall, wide))
    patches = np.stack(
        [
            _pictures(_relief(shape, die, m, (rows, cols), look), look)
            for shape, m in zip(shapes, middle, strict=True)
        ]
    )
    # one unit of each weight means the same root mean square, over all characters
    for part in (slice(0, 2), slice(2, 3)):
        patches[:, part] /= np.sqrt((patches[:, part].astype(np.float64) ** 2).mean())
    gram = np.einsum("tbdrc,tedrc->tbe", patches, patches, dtype=np.float64)
    return VisionBasis(
        font=font.name,
        look=look,
        chars=tuple(chars),
        patches=patches,
        gram=gram,
        half_width=half,
        middle=middle,
        advance=np.array([shape.advance for shape in shapes]),
    )


def _relief(shape: Glyph, die: Die, middle: float, size: tuple[int, int], look: Look) -> NDArray[np.float32]:
    """Relief over the character height, on a grid finer than the template's."""
    rows, cols, fine = size[0] * _FINE, size[1] * _FINE, look.pixels * _FINE
    x = (np.arange(cols) - 0.5 * (cols - 1)) / fine + middle
    y = 0.5 - (np.arange(rows) - 0.5 * (rows - 1)) / fine
    height = _NOMINAL_MM
    z = shape_relief_mm(shape, die, x[None, :] * height, y[:, None] * height, height_mm=height)
    return np.asarray(np.broadcast_to(z, (rows, cols)) / np.float32(height), dtype=np.float32)


def _pictures(relief: NDArray[np.float32], look: Look) -> NDArray[np.float32]:
    """(3, 2, rows, cols) edges of the relief lit along x, along y, and filled."""
    from scipy import ndimage

    rows, cols = relief.shape[0] // _FINE, relief.shape[1] // _FINE
    slope_y, slope_x = np.gradient(relief)
    out = np.empty((3, 2, rows, cols), dtype=np.float32)
    for b, fine in enumerate((slope_x, slope_y, relief)):
        seen = fine.reshape(rows, _FINE, cols, _FINE).mean(axis=(1, 3))
        seen = ndimage.gaussian_filter(seen, FOCUS_HEIGHTS * look.pixels)
        out[b] = derivatives(seen, scale_px=look.scale_heights * look.pixels)
    return out
