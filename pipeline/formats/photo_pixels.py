"""Pixels of a decoded file made those of a photograph: turned upright, opaque, stretched.

decoded (rows, cols, 3 or 4) --turn_upright--> --lay_on_ground--> (rows, cols, 3) --stretch--> 8 or 16 bit
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Decoded = NDArray[np.unsignedinteger[Any]]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

_SAMPLED = 1_000_000
"""Numbers of a picture that percentiles are taken of: more tell no more."""
_DARK_PERCENT, _BRIGHT_PERCENT = 1.0, 99.0
"""Percentiles of 16 bit pictures: what lies far beyond is a hot pixel or a glint."""
_BELOW, _ABOVE = 1.0, 2.0
"""Range kept below and above the percentiles, of their distance: flanks of a small line lie there, and photographs
of 8 bit fill about as much of their scale."""
_BLANK = 2.0 / 255.0
"""Range of the middle 99.8 % of a blank page, of the full scale."""


def turn_upright(pixels: Decoded, orientation: int) -> Decoded:
    """A picture turned as its EXIF orientation (1 to 8) says; other numbers turn nothing."""
    turned = np.rot90(pixels, {3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}.get(orientation, 0))
    return turned[:, ::-1] if orientation in (2, 4, 5, 7) else turned


def lay_on_ground(pixels: Decoded) -> tuple[Decoded, str]:
    """(rows, cols, 3) pixels made opaque, and the ground ("white", "black") that shows through; "" if none does.

    Evenly opaque or transparent pictures keep their colours. Where what is opaque is dark the ground is white, else
    black.
    """
    colours = pixels[..., :3]
    if pixels.shape[2] < 4:
        return colours, ""
    opacity = pixels[..., 3]
    if opacity.min() == opacity.max():
        return colours, ""
    full = np.float32(np.iinfo(pixels.dtype).max)
    share = opacity[..., None].astype(np.float32) / full
    seen = colours * share
    bright = float(seen.mean() / share.mean()) > 0.5 * full
    ground = np.float32(0.0) if bright else full
    made = np.rint(seen + ground * (1.0 - share)).astype(pixels.dtype)
    return made, "black" if bright else "white"


def stretch(pixels: Decoded) -> Pixels:
    """Pixels of 16 bit stretched over their full scale; of 8 bit as they are.

    The scale ends a little beyond the percentiles, and nowhere beyond the numbers there are.
    """
    if pixels.dtype == np.uint8:
        return pixels.view(np.uint8)
    some = _some(pixels)
    dark, bright = np.percentile(some, (_DARK_PERCENT, _BRIGHT_PERCENT))
    least, most = float(pixels.min()), float(pixels.max())
    if bright > dark:
        least = max(least, dark - _BELOW * (bright - dark))
        most = min(most, bright + _ABOVE * (bright - dark))
    gain = np.float32(65535.0 / max(most - least, 1.0))
    made = (pixels.astype(np.float32) - np.float32(least)) * gain
    return np.asarray(np.clip(np.rint(made), 0.0, 65535.0), dtype=np.uint16)


def is_blank(pixels: Decoded) -> bool:
    """Whether a page shows nothing."""
    made, _ = lay_on_ground(pixels)
    low, high = np.percentile(_some(made), (0.1, 99.9))
    return bool(high - low < _BLANK * np.iinfo(made.dtype).max)


def _some(pixels: Decoded) -> NDArray[np.float32]:
    flat = pixels.reshape(-1)
    return np.asarray(flat[:: max(1, flat.size // _SAMPLED)], dtype=np.float32)
