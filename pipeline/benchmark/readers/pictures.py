"""Pictures of one line of text, for other programs.

    photo    the photograph, in colour
    edges    the edge map of touch, the strongest edge of any direction dark on light
    relief   the heights that touch felt, low dark
    ideal    the true heights, low dark: the result of a perfect instrument

Each is cropped to the line with a margin of a quarter of its height: to its true place if that is known, else to the
place that touch found, else not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.exam.specimens import Box
from pipeline.benchmark.readers.mode import PartReadings
from recognition.see.photo_frame import photo_origin_mm

if TYPE_CHECKING:
    from glyphs.surface.maps import EdgeMap, HeightMap

# around the line, as a share of its height: under the camera a part lies a little off its nominal place
MARGIN = 0.25
# percentile of the edge strength that is drawn black
SHARPEST = 98.0
# percentiles of the heights of a line that are drawn black and white
_LEVELS = (1.0, 99.0)
# sigma of the plate's form that is subtracted, and the height above it at which the rest is clipped: the best of the
# settings tried for RapidOCR on a felt relief
BROAD_MM, CLIP_MM = 2.0, 0.3


def photo_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The photograph, cropped to the line, (rows, cols, 3)."""
    photo = senses.photo
    pixels = photo.eight_bit if photo.pixels.ndim == 3 else np.repeat(photo.eight_bit[..., None], 3, axis=2)
    # without a scale nothing can be cropped, so the plate need not be scanned to find the line
    box = None if photo.pitch_mm is None else _line(senses)
    if box is None or photo.pitch_mm is None:
        return pixels
    return _cut(pixels, box, origin_mm=photo_origin_mm(photo), pitch_mm=photo.pitch_mm)


def edges_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The edge map of touch, drawn in grey and cropped to the line, (rows, cols, 3); a MarksError without one."""
    edges = senses.edges
    drawn = np.repeat(draw_edges(edges)[..., None], 3, axis=2)
    return _cut(drawn, _line(senses), origin_mm=edges.origin_mm, pitch_mm=edges.pitch_mm)


def draw_edges(edges: EdgeMap) -> NDArray[np.uint8]:
    """An edge map in grey, (rows, cols): the strongest edge of any direction, dark on light."""
    strength = np.abs(np.where(edges.valid, edges.enhancement, 0.0)).max(axis=0)
    most = max(float(np.percentile(strength, SHARPEST)), 1e-6)
    return np.asarray(255.0 * (1.0 - np.clip(strength / most, 0.0, 1.0)), dtype=np.uint8)


def _line(senses: PartReadings) -> Box | None:
    if senses.specimen.line_mm is not None:
        return senses.specimen.line_mm
    box = senses.touch.box
    return None if box is None else (box.x0_mm, box.y0_mm, box.x1_mm, box.y1_mm)


def _cut(
    picture: NDArray[Any], box: Box | None, *, origin_mm: Sequence[float], pitch_mm: float
) -> NDArray[Any]:
    if box is None:
        return picture
    grow = MARGIN * (box[3] - box[1])
    x0, x1 = ((v - origin_mm[0]) / pitch_mm for v in (box[0] - grow, box[2] + grow))
    y0, y1 = ((v - origin_mm[1]) / pitch_mm for v in (box[1] - grow, box[3] + grow))
    rows = slice(max(0, round(y0)), max(0, round(y1) + 1))
    columns = slice(max(0, round(x0)), max(0, round(x1) + 1))
    return np.ascontiguousarray(picture[rows, columns])


def relief_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The felt heights, drawn in grey and cropped to the line, (rows, cols, 3); a MarksError without a relief."""
    relief = senses.relief
    cut = _cut(relief.height_mm, _line(senses), origin_mm=relief.origin_mm, pitch_mm=relief.pitch_mm)
    return _grey(cut, pitch_mm=relief.pitch_mm)


def ideal_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The true heights, drawn in grey and cropped to the line, (rows, cols, 3)."""
    return heights_picture(senses.specimen.height_map, _line(senses))


def heights_picture(surface: HeightMap, box: Box | None) -> NDArray[np.uint8]:
    """The heights of a surface, drawn in grey and cropped to a line, (rows, cols, 3)."""
    cut = _cut(surface.z_mm, box, origin_mm=(0.0, 0.0), pitch_mm=surface.pitch_mm)
    return _grey(cut, pitch_mm=surface.pitch_mm)


PICTURES: dict[str, Callable[[PartReadings], NDArray[np.uint8]]] = {
    "photo": photo_picture,
    "edges": edges_picture,
    "relief": relief_picture,
    "ideal": ideal_picture,
}


def _grey(heights_mm: NDArray[np.float32], *, pitch_mm: float) -> NDArray[np.uint8]:
    return np.repeat(draw_heights(heights_mm, pitch_mm=pitch_mm)[..., None], 3, axis=2)


def draw_heights(heights_mm: NDArray[np.float32], *, pitch_mm: float) -> NDArray[np.uint8]:
    """Heights (rows, cols) from black to white without the plate's form; missing points (NaN) are grey."""
    flat = np.clip(remove_form(heights_mm, pitch_mm=pitch_mm), -CLIP_MM, CLIP_MM)
    low, high = np.nanpercentile(flat, _LEVELS) if np.isfinite(flat).any() else (0.0, 1.0)
    scaled = np.clip((flat - low) / max(float(high - low), 1e-6), 0.0, 1.0)
    return np.asarray(255.0 * np.where(np.isfinite(scaled), scaled, 0.5), dtype=np.uint8)


def remove_form(heights_mm: NDArray[np.float32], *, pitch_mm: float) -> NDArray[np.float64]:
    """Subtract plane and Gaussian mean from heights, (rows, cols); NaN stays NaN."""
    from scipy.ndimage import gaussian_filter

    z = np.asarray(heights_mm, dtype=np.float64)
    known = np.isfinite(z)
    if known.sum() < 3:
        return z
    v, u = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in z.shape), indexing="ij")
    terms = np.stack([np.ones_like(u), u, v], axis=-1)
    plane, *_ = np.linalg.lstsq(terms[known], z[known], rcond=None)
    z = z - terms @ plane
    weight = gaussian_filter(known.astype(np.float64), BROAD_MM / pitch_mm)
    mean = gaussian_filter(np.where(known, z, 0.0), BROAD_MM / pitch_mm) / np.maximum(weight, 1e-6)
    return np.asarray(z - mean)
