"""Photograph -> EdgeMap: the camera's edge map, in the same frame and of the same type as touch's.

Paint, rust and grime reflect some share of the light that falls on them, a groove's walls another share of that:
in the logarithm of the brightness the two add up, and lamp and vignetting are a slow slope. Its derivatives along
+x and +y, at a scale that a stroke still shows, are the two layers::

    ln b    ____        ____          FORWARD_X layer:  \\/  /\\   darker, then brighter, towards +x
                \\______/              FORWARD_Y layer:  the same towards +y
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.surface.maps import EdgeMap, MapError, TraceDirection
from recognition.vision_frame import photo_origin_mm, photo_pitch_mm
from recognition.vision_pixels import all_beyond, cut_and_scaled, mean_of_table, sizes

DARK = 0.03
"""Brightness added before the logarithm: below it, noise is all that there is."""
GLARE_LEVEL, BLACK_LEVEL = 250, 2
"""Grey levels from and to which a pixel is clipped and tells nothing."""
CLIP = 0.8
"""Edges stronger than so many times the median edge count no more than that: glints and rims of paint do not vote."""
SCALE_HEIGHTS = 0.022
"""Scale of the derivative, character heights: a sixth of a stroke."""
LIGHT_HEIGHTS = 1.5
"""Width of the box, run twice, over which the slope of the light is taken off, character heights."""
DIRECTIONS = (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y)


def log_brightness(photo: Photo, *, contrast: bool = False) -> NDArray[np.float32]:
    """(rows, cols) natural logarithm of the brightness, geometric mean of the colours.

    Args:
        photo: as taken.
        contrast: weigh the colours so that they differ most over short distances: paint-filled marks on ground of
            another colour. Its sign is that of the brightness where the two agree.
    """
    # of every grey level once
    table = np.log(np.arange(256, dtype=np.float32) / np.float32(255.0) + np.float32(DARK))
    if photo.pixels.ndim == 2:
        return np.asarray(table[photo.pixels])
    if not contrast:
        return np.asarray(mean_of_table(np.ascontiguousarray(photo.pixels), table))
    from scipy import ndimage

    log = table[photo.pixels]
    reach = max(2.0, 0.05 * min(photo.shape))
    rest = (log - ndimage.gaussian_filter(log, (reach, reach, 0.0), truncate=2.0)).reshape(-1, 3)
    _, axes = np.linalg.eigh(rest.T.astype(np.float64) @ rest)
    axis = axes[:, -1] * (1.0 if axes[:, -1].sum() >= 0.0 else -1.0)
    return np.asarray(log @ axis.astype(np.float32))


def clipped(photo: Photo) -> NDArray[np.bool_]:
    """(rows, cols) where the sensor was driven to white (glare) or saw nothing."""
    p = photo.pixels if photo.pixels.ndim == 3 else photo.pixels[..., None]
    return np.asarray(all_beyond(np.ascontiguousarray(p), BLACK_LEVEL, GLARE_LEVEL))


def derivatives(log: NDArray[np.float32], *, scale_px: float) -> NDArray[np.float32]:
    """(2, rows, cols) derivatives along columns and rows over one scale: of a ramp, its rise over `scale_px`."""
    from scipy import ndimage

    out = np.empty((2, *log.shape), dtype=np.float32)
    for layer, order in enumerate(((0, 1), (1, 0))):
        ndimage.gaussian_filter(log, scale_px, order=order, output=out[layer], mode="nearest")
    return np.asarray(out * np.float32(scale_px))


def limited(
    layers: NDArray[np.float32], *, clip: float = CLIP, valid: NDArray[np.bool_] | None = None
) -> NDArray[np.float32]:
    """The edges, none stronger than `clip` medians, over their root mean square; 0 where not valid.

    For noise with heavy tails the correlation of limited values is the locally best detector of a faint shape.
    """
    layers = np.ascontiguousarray(layers, dtype=np.float32)
    size = sizes(layers)
    good = np.ones(size.shape, dtype=np.bool_) if valid is None else np.ascontiguousarray(valid)
    if not good.any():
        return np.zeros_like(layers)
    top = clip * float(np.median(size[good]))
    return np.asarray(cut_and_scaled(layers, size, good, np.float32(top)))


def vision_edges(
    photo: Photo,
    *,
    height_mm: float,
    signed: bool = True,
    even: bool = True,
    contrast: bool = False,
) -> EdgeMap:
    """The camera's edge map.

    Args:
        photo: as taken; without a pitch a pixel counts as one mm.
        height_mm: of the characters, about; it sets the scale of the derivative.
        signed: derivatives as they are; else their sizes, where the light is of no account.
        even: limit strong edges, divide by the map's root mean square and take off the slope of the light; else
            the relative change of brightness over one scale, as it is.
        contrast: as `log_brightness`.

    Returns:
        Two layers, FORWARD_X and FORWARD_Y; `valid` is cleared where the sensor clipped.

    Raises:
        MapError: a height of less than eight pixels.
    """
    from scipy import ndimage

    from glyphs.opencv import cv2

    pitch = photo_pitch_mm(photo)
    if not height_mm >= 8.0 * pitch:
        raise MapError(
            f"characters of {height_mm} mm are less than 8 pixels of {pitch} mm high",
            hint="take the photograph closer, or say how high they are",
        )
    scale = max(0.7, SCALE_HEIGHTS * height_mm / pitch)
    layers = derivatives(log_brightness(photo, contrast=contrast), scale_px=scale)
    blind = clipped(photo)
    if blind.any():
        blind = ndimage.binary_dilation(blind, iterations=max(1, math.ceil(2.0 * scale)))
    if even:
        layers = limited(layers, valid=~blind)
        reach = max(1, round(LIGHT_HEIGHTS * height_mm / pitch))
        # edges of both signs, none of them large: their mean over a character is the slope of the light
        slope = layers
        for _ in range(2):
            slope = np.stack([cv2.blur(a, (reach, reach), borderType=cv2.BORDER_REFLECT) for a in slope])
        layers = layers - slope
    layers = np.where(blind, np.float32(0.0), layers)
    return EdgeMap(
        enhancement=layers if signed else np.abs(layers),
        directions=DIRECTIONS,
        valid=~blind,
        pitch_mm=pitch,
        origin_mm=photo_origin_mm(photo),
    )
