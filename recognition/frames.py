"""The line frame and the channels that matching works on.

The line frame is the plate frame turned so that the line of characters runs along +u::

          plate (x, y)                     u =  cos (x - cx) + sin (y - cy)
             .  /                          v = -sin (x - cx) + cos (y - cy)
             . / rotation_deg
             ./_________ u                 (cx, cy): middle of the edge map
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import EdgeMap, TraceDirection
from recognition.reading import Box
from whisker_array.gridding import averaging


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

    def plate_from_line(self, u_mm: float, v_mm: float) -> tuple[float, float]:
        """Plate coordinates of a place in the line frame."""
        angle = math.radians(self.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        return (self.centre_mm[0] + cos * u_mm - sin * v_mm, self.centre_mm[1] + sin * u_mm + cos * v_mm)

    def plate_box(self, u0_mm: float, v0_mm: float, u1_mm: float, v1_mm: float) -> Box:
        """Axis-parallel hull, in the plate frame, of a rectangle in the line frame."""
        corners = [self.plate_from_line(u, v) for u in (u0_mm, u1_mm) for v in (v0_mm, v1_mm)]
        xs, ys = [c[0] for c in corners], [c[1] for c in corners]
        return Box(min(xs), min(ys), max(xs), max(ys))


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
    from scipy import ndimage

    stack = channels(edges.enhancement, edges.directions)
    rows, cols = edges.shape
    pitch = edges.pitch_mm
    x0, y0 = edges.origin_mm
    half_u, half_v = 0.5 * (cols - 1) * pitch, 0.5 * (rows - 1) * pitch
    centre = (x0 + half_u, y0 + half_v)
    if rotation_deg == 0.0:
        return LineImage(stack, pitch, pitch, (-half_u, -half_v), 0.0, centre)
    angle = math.radians(rotation_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    out_cols = math.ceil(cols * abs(cos) + rows * abs(sin))
    out_rows = math.ceil(rows * abs(cos) + cols * abs(sin))
    matrix = np.array([[cos, sin], [-sin, cos]])
    middle_in = 0.5 * (np.array([rows, cols]) - 1.0)
    middle_out = 0.5 * (np.array([out_rows, out_cols]) - 1.0)
    turned = np.empty((stack.shape[0], out_rows, out_cols), dtype=np.float32)
    for k in range(stack.shape[0]):
        ndimage.affine_transform(
            stack[k],
            matrix,
            offset=middle_in - matrix @ middle_out,
            output=turned[k],
            order=1,
            mode="constant",
        )
    origin = (-middle_out[1] * pitch, -middle_out[0] * pitch)
    return LineImage(turned, pitch, pitch, origin, rotation_deg, centre)


def resampled(image: LineImage, *, pitch_u_mm: float, pitch_v_mm: float) -> LineImage:
    """The image averaged onto another grid; different pitches along and across change a character's shape."""
    _, rows, cols = image.channels.shape
    u0, v0 = image.origin_mm
    n_u = int((cols - 1) * image.pitch_u_mm / pitch_u_mm + 1e-6) + 1
    n_v = int((rows - 1) * image.pitch_v_mm / pitch_v_mm + 1e-6) + 1
    along = averaging(np.arange(cols) * image.pitch_u_mm, np.arange(n_u) * pitch_u_mm, pitch_u_mm)
    across = averaging(np.arange(rows) * image.pitch_v_mm, np.arange(n_v) * pitch_v_mm, pitch_v_mm)
    along = along.multiply(1.0 / along.sum(axis=1)[:, None]).tocsr().astype(np.float32)
    across = across.multiply(1.0 / across.sum(axis=1)[:, None]).tocsr().astype(np.float32)
    out = np.stack([(along @ (across @ layer).T).T for layer in image.channels])
    return LineImage(
        np.ascontiguousarray(out, dtype=np.float32),
        pitch_u_mm,
        pitch_v_mm,
        (u0, v0),
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
