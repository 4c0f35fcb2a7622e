"""The line frame and the channels that matching works on.

The line frame is the plate frame turned so that the line of characters runs along +u::

          plate (x, y)                     u =  cos (x - cx) + sin (y - cy)
             .  /                          v = -sin (x - cx) + cos (y - cy)
             . / rotation_deg
             ./_________ u                 (cx, cy): middle of the edge map
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import CONTRACTED, kernel, read_only
from glyphs.surface.maps import EdgeMap, TraceDirection

MOST_RESAMPLED = 8
"""Grids that an image keeps its averages on."""


@dataclass(frozen=True, eq=False)
class LineImage:
    """Channels on a grid of the line frame.

    Attributes:
        channels: (channels, rows, cols) float32.
        pitch_u_mm, pitch_v_mm: grid pitch along and across the line.
        origin_mm: (u, v) of pixel (0, 0).
        rotation_deg: of the line frame against the plate frame.
        centre_mm: plate (x, y) about which it is turned.
    """

    channels: NDArray[np.float32]
    pitch_u_mm: float
    pitch_v_mm: float
    origin_mm: tuple[float, float]
    rotation_deg: float
    centre_mm: tuple[float, float]
    _resampled: dict[tuple[float, float], LineImage] = field(default_factory=dict, init=False, repr=False)

    def plate_from_line(self, u_mm: float, v_mm: float) -> tuple[float, float]:
        """Plate coordinates of a place in the line frame."""
        angle = math.radians(self.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        return (self.centre_mm[0] + cos * u_mm - sin * v_mm, self.centre_mm[1] + sin * u_mm + cos * v_mm)

    def from_plate(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) u, v of places x, y of the plate."""
        angle = math.radians(self.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        off = places - np.array(self.centre_mm)
        return np.stack([cos * off[:, 0] + sin * off[:, 1], cos * off[:, 1] - sin * off[:, 0]], axis=1)


def channels(
    layers: NDArray[np.float32], directions: tuple[TraceDirection, ...], *, axis: int = 0
) -> NDArray[np.float32]:
    """Profile and edge channels of directional layers: half sums and half differences of opposite traces.

    Forward and back see the profile alike and the step of eq. (16) with opposite sign. With all four directions:
    profile (weight 2, two pairs agree on it), edge along x and edge along y (weight sqrt 2): sums of squares
    stay those of the layers. Directions without a partner stand for themselves.
    """
    by = {d: np.take(layers, i, axis=axis) for i, d in enumerate(directions)}
    profiles, rest = [], []
    for forward, back in (
        (TraceDirection.FORWARD_X, TraceDirection.BACK_X),
        (TraceDirection.FORWARD_Y, TraceDirection.BACK_Y),
    ):
        if forward in by and back in by:
            profiles.append(0.5 * (by[forward] + by[back]))
            rest.append(math.sqrt(0.5) * (by[forward] - by[back]))
        else:
            rest.extend(by[d] for d in (forward, back) if d in by)
    if profiles:
        rest.insert(0, math.sqrt(2.0 / len(profiles)) * np.sum(profiles, axis=0))
    return np.ascontiguousarray(np.stack(rest, axis=axis), dtype=np.float32)


def is_edge_channel(directions: tuple[TraceDirection, ...]) -> NDArray[np.bool_]:
    """Which of `channels` answer edges alone (differences of opposite traces), not the profile.

    Directions without a partner answer both; where there is no pair at all, every channel counts.
    """
    edge: list[bool] = []
    for forward in (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y):
        felt = sum(d in directions for d in (forward, TraceDirection(forward + 180)))
        edge += {0: [], 1: [False], 2: [True]}[felt]
    return np.array([False, *edge]) if any(edge) else np.ones(len(edge), dtype=np.bool_)


def line_image(edges: EdgeMap, *, rotation_deg: float) -> LineImage:
    """The channels of an edge map in the line frame, at the map's own pitch."""
    stack = channels(edges.enhancement, edges.directions)
    rows, cols = edges.shape
    pitch = edges.pitch_mm
    x0, y0 = edges.origin_mm
    half_u, half_v = 0.5 * (cols - 1) * pitch, 0.5 * (rows - 1) * pitch
    centre = (x0 + half_u, y0 + half_v)
    upright = LineImage(stack, pitch, pitch, (-half_u, -half_v), 0.0, centre)
    return turned(upright, rotation_deg=rotation_deg) if rotation_deg else upright


def turned(upright: LineImage, *, rotation_deg: float) -> LineImage:
    """An upright image of square pixels in a frame turned about its middle; land beyond it."""
    angle = math.radians(rotation_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    _, rows, cols = upright.channels.shape
    out_cols = math.ceil(cols * abs(cos) + rows * abs(sin))
    out_rows = math.ceil(rows * abs(cos) + cols * abs(sin))
    origin = (-0.5 * (out_cols - 1) * upright.pitch_u_mm, -0.5 * (out_rows - 1) * upright.pitch_v_mm)
    channels = np.zeros((upright.channels.shape[0], out_rows, out_cols), dtype=np.float32)
    _turned(read_only(upright.channels), cos, sin, channels)
    return replace(upright, channels=channels, origin_mm=origin, rotation_deg=rotation_deg)


@kernel()
def _turned(layers, cos, sin, out):  # type: ignore[no-untyped-def]
    """Bilinear, about the middle; `out` stays as it is beyond the image."""
    count, rows, cols = layers.shape
    _, out_rows, out_cols = out.shape
    for i in range(out_rows):
        v = i - 0.5 * (out_rows - 1)
        for j in range(out_cols):
            u = j - 0.5 * (out_cols - 1)
            row, col = 0.5 * (rows - 1) + cos * v + sin * u, 0.5 * (cols - 1) - sin * v + cos * u
            if row < 0.0 or col < 0.0 or row > rows - 1 or col > cols - 1:
                continue
            r, c = min(int(row), rows - 2), min(int(col), cols - 2)
            down, right = row - r, col - c
            for k in range(count):
                upper = layers[k, r, c] * (1.0 - right) + layers[k, r, c + 1] * right
                lower = layers[k, r + 1, c] * (1.0 - right) + layers[k, r + 1, c + 1] * right
                out[k, i, j] = upper * (1.0 - down) + lower * down


def _triangles(
    n_samples: int, n_pixels: int, step: float, pitch: float
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """First sample of each pixel and the weights from it on: a triangle one pixel, or step, wide to each side."""
    reach = max(pitch, step) * (1.0 + 1e-6)
    most = min(n_samples, int(2.0 * reach / step) + 2)
    middle = np.arange(n_pixels) * pitch
    first = np.clip(np.ceil((middle - reach) / step).astype(np.int64), 0, n_samples - most)
    sample = (first[:, None] + np.arange(most)) * step
    weight = np.maximum(1.0 - np.abs(middle[:, None] - sample) / reach, 0.0)
    return first, (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)


@kernel(allow=CONTRACTED)
def _averaged(layers, first_v, weight_v, first_u, weight_u, line, out):  # type: ignore[no-untyped-def]
    """Weighted sums down, into `line`, then along; weight_u is (samples, pixels)."""
    count, _, cols = layers.shape
    for k in range(count):
        for i in range(first_v.size):
            for c in range(cols):
                line[c] = np.float32(0.0)
            for j in range(weight_v.shape[1]):
                w, sample = weight_v[i, j], layers[k, first_v[i] + j]
                for c in range(cols):
                    line[c] += w * sample[c]
            row = out[k, i]
            for p in range(first_u.size):
                row[p] = np.float32(0.0)
            for j in range(weight_u.shape[0]):
                w = weight_u[j]
                for p in range(first_u.size):
                    row[p] += w[p] * line[j + first_u[p]]


def resampled(image: LineImage, *, pitch_u_mm: float, pitch_v_mm: float) -> LineImage:
    """The image averaged onto another grid; different pitches along and across change a character's shape.

    The last few are kept with the image: fonts and hands are tried at the same heights, one after the other.
    """
    key, kept = (pitch_u_mm, pitch_v_mm), image._resampled
    if key not in kept:
        while len(kept) >= MOST_RESAMPLED:
            del kept[next(iter(kept))]
        kept[key] = _averaged_onto(image, pitch_u_mm, pitch_v_mm)
    return kept[key]


def _averaged_onto(image: LineImage, pitch_u_mm: float, pitch_v_mm: float) -> LineImage:
    _, rows, cols = image.channels.shape
    n_u = int((cols - 1) * image.pitch_u_mm / pitch_u_mm + 1e-6) + 1
    n_v = int((rows - 1) * image.pitch_v_mm / pitch_v_mm + 1e-6) + 1
    first_u, weight_u = _triangles(cols, n_u, image.pitch_u_mm, pitch_u_mm)
    first_v, weight_v = _triangles(rows, n_v, image.pitch_v_mm, pitch_v_mm)
    layers, along = read_only(image.channels, np.float32), np.ascontiguousarray(weight_u.T)
    channels = np.empty((layers.shape[0], n_v, n_u), dtype=np.float32)
    _averaged(layers, first_v, weight_v, first_u, along, np.empty(cols, dtype=np.float32), channels)
    return LineImage(
        channels,
        pitch_u_mm,
        pitch_v_mm,
        image.origin_mm,
        image.rotation_deg,
        image.centre_mm,
    )


def padded(image: LineImage, pixels: int) -> LineImage:
    """The image with land, which is zero, around it."""
    wide = np.pad(image.channels, ((0, 0), (pixels, pixels), (pixels, pixels)))
    u0, v0 = image.origin_mm
    return replace(
        image, channels=wide, origin_mm=(u0 - pixels * image.pitch_u_mm, v0 - pixels * image.pitch_v_mm)
    )
