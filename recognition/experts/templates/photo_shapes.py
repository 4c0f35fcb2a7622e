"""What the ideal die does to the brightness of a photograph, whatever the light.

A distant lamp brightens a wall by its slope towards it: brightness ~ l . grad h, with the azimuth of l unknown.
Dirt, paint or shadow in a groove makes the stroke itself darker or brighter: brightness ~ h. So every character
has three pictures, and a line of characters one weight for each of them::

    dh/dx: lit along x      dh/dy: lit along y      h: filled strokes

Paint, rust and grime reflect some share of the light that falls on them, a groove's walls another share of that: in the
logarithm of the brightness the two add up, and lamp and vignetting are a slow slope. So both are compared by the
derivatives of the logarithm along x and y, at a scale that a stroke still shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph
from glyphs.stamping.die import Die, die_glyph, shape_relief_mm
from glyphs.stamping.faces import default_die

Floats = NDArray[np.float64]
Edges = NDArray[np.float32]

PICTURES = 3
SCALE_HEIGHTS = 0.022
"""Scale of the derivative, character heights: a sixth of a stroke."""
DARK = 0.03
"""Brightness added before the logarithm: below it, noise is all that there is."""
GLARE, BLACK = 0.98, 0.008
"""Brightness from and to which a pixel is clipped and tells nothing."""
CLIP = 0.8
"""Edges stronger than so many times the median edge count no more than that: glints and rims of paint do not vote."""
_LEAST_EDGE = 1e-4
"""Relative change of brightness below which there is none: a grey level is a hundred times as much."""
_RIM_HEIGHTS = 0.16
"""Land around the ink in a picture, character heights."""
_FOCUS_HEIGHTS = 0.02
"""Blur of a camera that is about in focus, character heights."""
_FINE, _NOMINAL_MM = 4, 5.0


@dataclass(frozen=True, eq=False)
class PhotoShapes:
    """The three pictures of every character of a font.

    Attributes:
        pixels: to the character height.
        chars: (T,) characters.
        patches: (T, 3, 2, rows, cols) lit along x, lit along y, filled; derivatives along columns and rows. Rows and
            columns odd; the middle pixel is the middle of the ink's width at half the height.
        gram: (T, 3, 3) products of a character's pictures with each other.
        middle: (T,) from the character's origin to the middle of its ink, pixels.
        advance: (T,) from its origin to the next one's, pixels.
    """

    pixels: int
    chars: str
    patches: Edges
    gram: Floats
    middle: Floats
    advance: Floats


def photo_shapes(font: Font, chars: str, *, pixels: int) -> PhotoShapes:
    """Draw the pictures of a font's characters.

    Args:
        font: which.
        chars: characters that it has.
        pixels: to the character height.

    Raises:
        FontError: a character that the font has not got.
        StampError: a die that cannot be.
    """
    die = default_die(_NOMINAL_MM, font=font)
    shapes = [die_glyph(font.glyph(c), die, height_mm=_NOMINAL_MM) for c in chars]
    boxes = np.array([shape.ink_box for shape in shapes])
    middle = 0.5 * (boxes[:, 2] + boxes[:, 0])
    tall = float(max(boxes[:, 3].max() - 0.5, 0.5 - boxes[:, 1].min())) + _RIM_HEIGHTS
    wide = float(0.5 * (boxes[:, 2] - boxes[:, 0]).max()) + _RIM_HEIGHTS
    rows, cols = (2 * math.ceil(extent * pixels) + 1 for extent in (tall, wide))
    patches = np.stack(
        [
            _pictures(_relief(shape, die, m, (rows, cols), pixels), pixels)
            for shape, m in zip(shapes, middle, strict=True)
        ]
    )
    # one unit of each weight means the same root mean square, over all characters
    for part in (slice(0, 2), slice(2, 3)):
        patches[:, part] /= np.sqrt((patches[:, part].astype(np.float64) ** 2).mean())
    return PhotoShapes(
        pixels=pixels,
        chars=chars,
        patches=patches,
        gram=np.einsum("tbdrc,tedrc->tbe", patches, patches, dtype=np.float64),
        middle=middle * pixels,
        advance=np.array([shape.advance for shape in shapes]) * pixels,
    )


def photo_edges(grey: Edges, known: NDArray[np.bool_], *, pixels: int) -> Edges:
    """(2, rows, cols) derivatives of the logarithm of a strip's brightness, limited, over their root mean square.

    For noise with heavy tails the correlation of limited values is the locally best detector of a faint shape.

    Args:
        grey: (rows, cols) 0 to 1.
        known: (rows, cols).
        pixels: to a character's height.
    """
    from glyphs.opencv import cv2

    told = known & (grey > BLACK) & (grey < GLARE)
    layers = _derivatives(np.log(grey + np.float32(DARK)), pixels)
    reach = 2 * math.ceil(2.0 * SCALE_HEIGHTS * pixels) + 1
    clear = cv2.erode(told.astype(np.uint8), np.ones((reach, reach), dtype=np.uint8), borderValue=1) > 0
    strength = float(np.sqrt((layers[:, clear] ** 2).mean())) if clear.any() else 0.0
    if strength < _LEAST_EDGE:
        return np.zeros_like(layers)
    size = np.hypot(*layers)
    top = CLIP * float(np.median(size[clear]))
    layers *= np.where(clear, np.minimum(1.0, top / np.maximum(size, 1e-12)), 0.0)
    return np.asarray(layers / max(float(np.sqrt((layers[:, clear] ** 2).mean())), 1e-12), dtype=np.float32)


def _derivatives(picture: Edges, pixels: int) -> Edges:
    """(2, rows, cols) derivatives along columns and rows over one scale."""
    from scipy import ndimage

    scale = max(0.7, SCALE_HEIGHTS * pixels)
    return np.stack(
        [ndimage.gaussian_filter(picture, scale, order=order, mode="nearest") for order in ((0, 1), (1, 0))]
    ).astype(np.float32)


def _relief(shape: Glyph, die: Die, middle: float, size: tuple[int, int], pixels: int) -> Edges:
    """Relief over the character height, on a grid finer than the picture's."""
    rows, cols, fine = size[0] * _FINE, size[1] * _FINE, pixels * _FINE
    x = (np.arange(cols) - 0.5 * (cols - 1)) / fine + middle
    y = 0.5 - (np.arange(rows) - 0.5 * (rows - 1)) / fine
    z = shape_relief_mm(shape, die, x[None, :] * _NOMINAL_MM, y[:, None] * _NOMINAL_MM, height_mm=_NOMINAL_MM)
    return np.asarray(np.broadcast_to(z, (rows, cols)) / np.float32(_NOMINAL_MM), dtype=np.float32)


def _pictures(relief: Edges, pixels: int) -> Edges:
    """(3, 2, rows, cols) edges of the relief lit along x, along y, and filled."""
    from scipy import ndimage

    rows, cols = relief.shape[0] // _FINE, relief.shape[1] // _FINE
    slope_y, slope_x = np.gradient(relief)
    made = []
    for fine in (slope_x, slope_y, relief):
        seen = fine.reshape(rows, _FINE, cols, _FINE).mean(axis=(1, 3))
        made.append(_derivatives(ndimage.gaussian_filter(seen, _FOCUS_HEIGHTS * pixels), pixels))
    return np.stack(made)
