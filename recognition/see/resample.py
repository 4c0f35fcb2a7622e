"""Resample a view to another pitch, or turn it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recognition.see.view import EDGES, GREY, KNOWN, View, turned_edges


def resample(
    view: View, pitch_mm: float, *, blur: float = 0.4, most_blurred: float = 8.0
) -> NDArray[np.float32]:
    """Resample layers to another pitch, from the same origin; blur them first if the new pitch is coarser.

    For a pitch r > 1 times the old one, sigma of the blur is `blur * (r - 1)` old pixels. From r = `most_blurred` the
    view is halved first: a wide blur of many pixels takes long.
    """
    from glyphs.opencv import cv2

    rows, columns = (max(8, int((n - 1) * view.pitch_mm / pitch_mm) + 1) for n in view.layers.shape[1:])
    x_mm, y_mm = view.origin_mm
    while pitch_mm >= most_blurred * view.pitch_mm and min(view.layers.shape[1:]) >= 16:
        view = view.halved
    ratio = pitch_mm / view.pitch_mm
    start = ((x_mm - view.origin_mm[0]) / view.pitch_mm, (y_mm - view.origin_mm[1]) / view.pitch_mm)
    known = view.layers[KNOWN]
    sigma = blur * max(ratio - 1.0, 0.0)
    weight = np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), 1e-3) if sigma else known
    resampled = np.zeros((len(view.layers), rows, columns), dtype=np.float32)
    back = np.array([[ratio, 0.0, start[0]], [0.0, ratio, start[1]]])
    for layer in view.filled:
        values = view.layers[layer]
        if sigma and layer != KNOWN:
            values = cv2.GaussianBlur(values * known, (0, 0), sigma) / weight
        resampled[layer] = cv2.warpAffine(
            values,
            back,
            (columns, rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    resampled[KNOWN] = resampled[KNOWN] > 0.5
    return np.asarray(resampled * resampled[KNOWN], dtype=np.float32)


def turn_view(view: View, turned_deg: float) -> View:
    """Turn the axes of a view clockwise as seen about its middle: lines with this rotation become level."""
    from glyphs.opencv import cv2

    cos, sin = math.cos(math.radians(turned_deg)), math.sin(math.radians(turned_deg))
    rows, columns = view.layers.shape[1:]
    size = tuple(math.ceil(abs(cos) * a + abs(sin) * b - 1e-6) for a, b in ((columns, rows), (rows, columns)))
    # from pixels of the turned grid to those of the view, both from their middles
    back = np.array([[cos, -sin, 0.0], [sin, cos, 0.0]])
    middles = [np.array([(n - 1) / 2 for n in shape]) for shape in (size, (columns, rows))]
    back[:, 2] = middles[1] - back[:, :2] @ middles[0]
    turned = np.zeros((len(view.layers), size[1], size[0]), dtype=np.float32)
    for layer in view.filled:
        turned[layer] = cv2.warpAffine(
            view.layers[layer], back, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        )
    turned[KNOWN] = turned[KNOWN] > 0.999
    turned *= turned[KNOWN]
    if turned[GREY].any():
        # outside, use the median brightness of the picture, so that its rim does not look like a stroke
        turned[GREY] += (1.0 - turned[KNOWN]) * float(np.median(view.layers[GREY]))
    turned[EDGES:KNOWN] = turned_edges(turned[EDGES:KNOWN], turned_deg)
    origin_mm = (-middles[0][0] * view.pitch_mm, -middles[0][1] * view.pitch_mm)
    return replace(view, layers=turned, origin_mm=origin_mm)


def turn_back(points_mm: NDArray[np.float64], view: View, turned_deg: float) -> NDArray[np.float64]:
    """Convert (n, 2) positions on the turned view to positions on the view."""
    cos, sin = math.cos(math.radians(turned_deg)), math.sin(math.radians(turned_deg))
    middle = np.array(view.origin_mm) + 0.5 * np.array(view.size_mm)
    return np.asarray(points_mm @ np.array([[cos, sin], [-sin, cos]]) + middle)
