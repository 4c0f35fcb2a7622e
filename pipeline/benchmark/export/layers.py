"""Maps of numbers as pictures of 16 bit, with their scale in the file.

value = (pixel - ZERO) * step        pixel 0: not known

The PNG's text says `step`, `zero`, `unit`, `pitch_mm` and `origin_mm`, the place of the first pixel.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from pipeline.common.output_paths import check_writable

ZERO = 32768
FINEST = 1e-4
"""Step of a map that lies within ±3.2766: of heights a tenth of a micrometre, below what any instrument here feels."""
_MOST = ZERO - 1


def step_of(values: NDArray[np.floating]) -> float:
    """The step that all of a map fits: `FINEST`, or the least doubling of it."""
    most = float(np.nanmax(np.abs(values), initial=0.0))
    return FINEST * 2.0 ** max(0, math.ceil(math.log2(max(most, 1e-12) / (FINEST * _MOST))))


def write_layer(
    path: Path, values: NDArray[np.floating], *, unit: str, pitch_mm: float, origin_mm: tuple[float, float]
) -> float:
    """Write a map as PNG, whole or not at all.

    Args:
        path: ends in .png.
        values: (rows, cols), NaN where not known.
        unit: of the values.
        pitch_mm: of the grid.
        origin_mm: (x, y) of its first sample.

    Returns:
        The step.

    Raises:
        FileError: another suffix, or it cannot be written.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    check_writable(path, (".png",))
    step = step_of(values)
    known = np.isfinite(values)
    pixels = np.where(known, np.rint(np.where(known, values, 0.0) / step) + ZERO, 0.0).astype(np.uint16)
    text = PngInfo()
    scale = {"step": step, "zero": ZERO, "unit": unit, "pitch_mm": pitch_mm}
    for name, value in scale.items():
        text.add_text(name, str(value))
    text.add_text("origin_mm", "{:g} {:g}".format(*origin_mm))
    with replacing(path) as temporary:
        Image.fromarray(pixels).save(temporary, "PNG", compress_level=6, pnginfo=text)
    return step
