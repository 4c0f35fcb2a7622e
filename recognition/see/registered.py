"""Register several photographs of a part with the first: one view each, all in one frame.

    photographs --size of the gradient--> phase correlation, then ECC --> shift and turn --> views
    four or more views under different lights --> slopes, one more view
    one photograph in colour --> without stains

A lamp from another side turns bright flanks dark, but edges stay where they are. So sizes of gradients are compared.
Source: G. Evangelidis, E. Psarakis, IEEE PAMI 30 (2008) 1858 (ECC).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.see.slopes import slope_picture
from recognition.see.stains import without_stains
from recognition.see.view import GREY, KNOWN, View, layers_of, photo_view

Floats = NDArray[np.float32]
_PIXELS = 480
"""Pixels of the longer side at which photographs are compared."""
_DARK, _FOCUS, _CUT = 0.05, 1.2, 3.0
"""Brightness added before the logarithm; blur, pixels; limit of gradients, in root mean squares, against glints."""
_STEPS, _LEAST_GAIN = 60, 1e-5


def photo_views(photo: Photo) -> tuple[list[View], tuple[int, ...]]:
    """Views of the slopes, under four or more lights, and of each photograph; numbers of those left out, from 1."""
    first = photo_view(photo)
    if not photo.others:
        return [first], ()
    scale = min(1.0, _PIXELS / max(photo.shape))
    steady = _gradient(first.layers[GREY], scale)
    views, left_out = [first], []
    for number, other in enumerate(photo.others, start=2):
        grey = other.grey()
        motion = _motion(steady, _gradient(grey, scale))
        if motion is None:
            left_out.append(number)
        else:
            motion[:, 2] /= scale
            views.append(_warp_onto(first, grey, motion))
    return [*_slopes(views), *views], tuple(left_out)


def stainless_view(photo: Photo) -> View | None:
    """View of a colour photograph without its stains; None without stains."""
    clean = without_stains(photo)
    return None if clean is None else replace(photo_view(photo), layers=layers_of(GREY, clean))


def _slopes(views: list[View]) -> list[View]:
    known = np.all([view.layers[KNOWN] > 0.5 for view in views], axis=0)
    # what a photograph does not show is filled from the first, so that no edge appears there
    first = views[0].layers[GREY]
    picture = slope_picture([np.where(v.layers[KNOWN] > 0.5, v.layers[GREY], first) for v in views])
    if picture is None:
        return []
    return [replace(views[0], layers=layers_of(GREY, picture, known))]


def _gradient(grey: Floats, scale: float) -> Floats:
    from glyphs.opencv import cv2

    small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1.0 else grey
    log = cv2.GaussianBlur(np.log(small + np.float32(_DARK)), (0, 0), _FOCUS)
    size = np.hypot(cv2.Sobel(log, cv2.CV_32F, 1, 0), cv2.Sobel(log, cv2.CV_32F, 0, 1))
    top = _CUT * float(np.sqrt((size**2).mean())) or 1.0
    return np.asarray(np.minimum(size, top) / top, dtype=np.float32)


def _motion(steady: Floats, moving: Floats, *, least_alike: float = 0.15) -> NDArray[np.float32] | None:
    from glyphs.opencv import cv2

    (x, y), _ = cv2.phaseCorrelate(steady, moving, cv2.createHanningWindow(steady.shape[::-1], cv2.CV_32F))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, _STEPS, _LEAST_GAIN)
    everywhere = np.ones(steady.shape, dtype=np.uint8)
    fits: list[tuple[float, NDArray[np.float32]]] = []
    for start in ((x, y), (0.0, 0.0)):
        motion = np.array([[1.0, 0.0, start[0]], [0.0, 1.0, start[1]]], dtype=np.float32)
        try:
            alike, moved = cv2.findTransformECC(
                steady, moving, motion, cv2.MOTION_EUCLIDEAN, stop, everywhere, 3
            )
        except cv2.error:
            continue  # it did not converge
        fits.append((float(alike), np.asarray(moved, dtype=np.float32)))
        if alike > 2.0 * least_alike:
            break
    best = max(fits, key=lambda fit: fit[0], default=None)
    return best[1] if best is not None and best[0] >= least_alike else None


def _warp_onto(first: View, grey: Floats, motion: NDArray[np.float32]) -> View:
    from glyphs.opencv import cv2

    size = first.layers.shape[:0:-1]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    known = cv2.warpAffine(np.ones_like(grey), motion, size, flags=flags) > 0.999
    moved = np.asarray(cv2.warpAffine(grey, motion, size, flags=flags))
    return replace(first, layers=layers_of(GREY, moved, known))
