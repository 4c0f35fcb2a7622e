"""Bare parts, for soils to be laid on."""

from __future__ import annotations

from functools import cache

import numpy as np

from glyphs import StampingVariation, stamp
from glyphs.soiling.coat import Coat, bare_coat


@cache
def bare_part(
    text: str = "B4",
    *,
    height_mm: float = 5.0,
    rows: int = 60,
    raised: bool = False,
    seed: int = 5,
    varied: bool = True,
) -> Coat:
    """A stamped part without soil, shared between tests, whose arrays cannot be written to.

    Args:
        text: what is stamped.
        height_mm: of its characters.
        rows: samples a character height.
        raised: whether the marks stand out of the plate.
        seed: of the stamping.
        varied: whether blows, letters and plate vary.
    """
    variation = None if varied else StampingVariation.none()
    part = stamp(
        text, height_mm=height_mm, pitch_mm=height_mm / rows, raised=raised, variation=variation, seed=seed
    )
    coat = bare_coat(part.stamped, rng=np.random.default_rng(1))
    for array in vars(coat).values():
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    return coat
