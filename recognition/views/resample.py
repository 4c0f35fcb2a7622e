"""A view on a grid of another pitch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.views.view import KNOWN, View

_BLUR = 0.4
"""Sigma of what a coarser grid is averaged by, its pixels beyond one."""


def resampled(view: View, pitch_mm: float) -> NDArray[np.float32]:
    """Layers on a grid of another pitch, from the same origin; finer ones are blurred before."""
    from glyphs.opencv import cv2

    ratio = pitch_mm / view.pitch_mm
    rows, columns = (max(8, int((n - 1) / ratio) + 1) for n in view.layers.shape[1:])
    known = view.layers[KNOWN]
    sigma = _BLUR * max(ratio - 1.0, 0.0)
    weight = np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), 1e-3) if sigma else known
    made = np.zeros((len(view.layers), rows, columns), dtype=np.float32)
    back = np.array([[ratio, 0.0, 0.0], [0.0, ratio, 0.0]])
    for layer in np.flatnonzero(view.layers.any(axis=(1, 2))):
        values = view.layers[layer]
        if sigma and layer != KNOWN:
            values = cv2.GaussianBlur(values * known, (0, 0), sigma) / weight
        made[layer] = cv2.warpAffine(
            values,
            back,
            (columns, rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    made[KNOWN] = made[KNOWN] > 0.5
    return np.asarray(made * made[KNOWN], dtype=np.float32)
