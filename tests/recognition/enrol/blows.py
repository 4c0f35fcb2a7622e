"""Reliefs of characters as blows leave them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.fonts.glyph import Font
from recognition.enrol.learned_font import Hand

SIZE = (53, 65)


def drawn(char: str, font: Font) -> NDArray[np.float32]:
    """A character of the font as it is."""
    relief = Hand(font, 1.0, 0.0, 0.0, 0.04, 1.0).relief(char, SIZE)
    assert relief is not None
    return relief


def blow(char: str, seed: int, font: Font) -> NDArray[np.float32]:
    """A character as a blow leaves it: moved, turned, deeper or not, rough."""
    rng = np.random.default_rng([ord(char), seed])
    turned = ndimage.rotate(drawn(char, font), rng.normal(0.0, 1.2), reshape=False, order=1)
    moved = ndimage.shift(turned, rng.normal(0.0, 0.8, 2), order=1) * rng.normal(1.0, 0.12)
    return np.asarray(moved + rng.normal(0.0, 0.001, SIZE), dtype=np.float32)
