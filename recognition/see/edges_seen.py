"""Whether a picture shows edges at all: one without is not searched.

grey --octaves of a Laplacian pyramid--> strongest contrast of each --above noise, and no mere blur?--> edges

Of a smooth function each octave has a quarter of the contrast of the next coarser one, of white noise three times that;
at an edge all octaves are about equal. Source: P. Burt, E. Adelson, IEEE Trans. Commun. 31 (1983) 532.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo

Floats = NDArray[np.float32]


class PictureFault(StrEnum):
    """Why a picture shows nothing that could be read; a blank one that is lit unevenly counts as out of focus."""

    NO_CONTRAST = "no contrast"
    OVEREXPOSED = "overexposed"
    OUT_OF_FOCUS = "out of focus"


def picture_fault(
    photo: Photo, *, white: float = 0.99, white_share: float = 0.5, least_range: float = 0.06
) -> PictureFault | None:
    """Why a photograph has no edges: overexposed or out of focus; None if it has some, or another of the part has."""
    if any(picture_fault(other) is None for other in photo.others):
        return None
    grey = photo.grey()
    if has_edges(grey, step=1.0 / float(np.iinfo(photo.pixels.dtype).max)):
        return None
    if float((grey >= white).mean()) >= white_share:
        return PictureFault.OVEREXPOSED
    *_, (_, coarse) = _octaves(grey)
    return PictureFault.OUT_OF_FOCUS if np.ptp(coarse) >= least_range else PictureFault.NO_CONTRAST


def has_edges(
    values: Floats,
    *,
    step: float,
    # ratio of the strongest contrast of an octave and its noise from which it is no noise; of white noise it
    # is 2, after JPEG at most 2.6
    noise_ratio: float = 2.7,
    colour: float = 1.3,
    # ratio of the contrasts of an octave and of the next coarser one up to which values are smooth
    smooth_ratio: float = 0.4,
) -> bool:
    """Whether values on a grid have edges that neither noise nor blur explains; `step` is their least difference."""
    known = np.isfinite(values)
    if not known.all():
        values = np.where(known, values, np.median(values[known]) if known.any() else 0.0)
    contrasts = (_local_contrast(band) for band, _ in _octaves(np.asarray(values, dtype=np.float32)))
    finest, white = 0.0, 1.0
    for number, (contrast, coarser) in enumerate(pairwise(contrasts)):
        noise = max(float(np.median(contrast[::4, ::4])), 0.5 * step * white)
        if number == 0:
            finest = noise
        noise = min(noise, colour * white * finest)
        if contrast.max() > max(noise_ratio * noise, smooth_ratio * float(coarser.max())):
            return True
        white *= 0.47 if number else 0.24
    return False


def _octaves(values: Floats, *, finest_blur: float = 12.0) -> Iterator[tuple[Floats, Floats]]:
    """Octaves of a picture, fine to coarse, each with the picture without it and all finer ones.

    `finest_blur` is the ratio to the coarsest octave: a blur as wide hides characters of any height.
    """
    from glyphs.opencv import cv2

    side = min(values.shape)
    for _ in range(max(3, int(np.log2(side / finest_blur)) + 2)):
        if min(values.shape) < 4:
            return
        coarse = np.asarray(cv2.pyrDown(values), dtype=np.float32)
        yield np.asarray(values - cv2.pyrUp(coarse, dstsize=values.shape[::-1]), dtype=np.float32), coarse
        values = coarse


def _local_contrast(band: Floats, *, window: int = 5, rim: int = 8) -> Floats:
    from glyphs.opencv import cv2

    contrast = np.sqrt(np.maximum(cv2.boxFilter(band * band, -1, (window, window)), 0.0))
    inner = contrast[rim:-rim, rim:-rim]
    return np.asarray(inner if inner.size else contrast, dtype=np.float32)
