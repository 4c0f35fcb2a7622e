"""The line that touch has read, and the camera's edges laid into its frame.

::

    plate --turned along the line--> line frame, `basis.look.pixels` to the height

    photo --plate_from_photo--> plate --> +---------------------------+
                                          |  K    7    B    2    9    |   (column, row) of every place
                                          +---------------------------+
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import EdgeMap
from recognition.lattice import Lattice
from recognition.vision_templates import VisionBasis

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FeltLine:
    """Where touch has characters, and which.

    Attributes:
        belief: (places, T) share of belief in each character of the basis; the rows sum to 1.
        middle_mm: (places, 2) plate frame.
        height_mm: of the characters.
        rotation_deg: of the line.
        basis: pictures of the characters for sight.
    """

    belief: Floats
    middle_mm: Floats
    height_mm: float
    rotation_deg: float
    basis: VisionBasis

    @property
    def pixel_mm(self) -> float:
        """Of the line frame."""
        return self.height_mm / self.basis.look.pixels

    @property
    def plate_from_line(self) -> Floats:
        """(3, 3) from (column, row, 1) of the line frame to plate (x, y, 1), mm."""
        angle = math.radians(self.rotation_deg)
        cos, sin, p = math.cos(angle), math.sin(angle), self.pixel_mm
        u, v = self._turned()
        rim = self._rim_mm()
        u0, v0 = float(u.min()) - rim, float(v.min()) - rim
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(turn @ np.array([[p, 0.0, u0], [0.0, p, v0], [0.0, 0.0, 1.0]]))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of the line frame."""
        u, v = self._turned()
        rim = 2.0 * self._rim_mm()
        return (
            math.ceil((np.ptp(v) + rim) / self.pixel_mm) + 1,
            math.ceil((np.ptp(u) + rim) / self.pixel_mm) + 1,
        )

    def places_px(self) -> Floats:
        """(places, 2) column and row of every place in the line frame."""
        flat = np.column_stack([self.middle_mm, np.ones(len(self.middle_mm))])
        return np.asarray((flat @ np.linalg.inv(self.plate_from_line).T)[:, :2])

    def _rim_mm(self) -> float:
        """Plate laid out around the places: room for the pictures."""
        return float(max(self.basis.patches.shape[3:]) // 2 + 2) * self.pixel_mm

    def _turned(self) -> tuple[Floats, Floats]:
        angle = math.radians(self.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        x, y = self.middle_mm.T
        return cos * x + sin * y, -sin * x + cos * y


def felt_line(
    lattice: Lattice, basis: VisionBasis, *, height_mm: float, rotation_deg: float = 0.0
) -> FeltLine | None:
    """The line of a lattice of touch; None where it has no places, no boxes, or none of the font's characters."""
    if not lattice.boxes:
        return None
    belief = np.zeros((lattice.n_places, len(basis.chars)))
    for t, char in enumerate(basis.chars):
        if char in lattice.chars:
            belief[:, t] = np.exp(lattice.log_belief[:, lattice.chars.index(char)])
    total = belief.sum(axis=1, keepdims=True)
    if (total <= 0.0).any():
        return None
    middle = np.array([[0.5 * (b.x0_mm + b.x1_mm), 0.5 * (b.y0_mm + b.y1_mm)] for b in lattice.boxes])
    return FeltLine(belief / total, middle, height_mm, rotation_deg, basis)


def laid(
    vision: EdgeMap, plate_from_photo: Floats, line: FeltLine, *, margin: int = 0
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The camera's edges in the frame of the line.

    Args:
        vision: signed derivatives along x and y, photo frame.
        plate_from_photo: (3, 3) homography.
        line: of touch.
        margin: pixels more on every side.

    Returns:
        (2, rows, cols) derivatives along and across the line, root mean square 1 where they can be relied upon;
        (rows, cols) how far, 0 to 1.
    """
    from glyphs.opencv import cv2

    rows, cols = (n + 2 * margin for n in line.shape)
    p, (x0, y0) = vision.pitch_mm, vision.origin_mm
    of_pixel = plate_from_photo @ np.array([[p, 0.0, x0], [0.0, p, y0], [0.0, 0.0, 1.0]])
    shift = np.array([[1.0, 0.0, -margin], [0.0, 1.0, -margin], [0.0, 0.0, 1.0]])
    to_pixel = np.linalg.inv(of_pixel) @ line.plate_from_line @ shift
    middle = to_pixel @ np.array([0.5 * cols, 0.5 * rows, 1.0])
    along = to_pixel @ np.array([0.5 * cols + 1.0, 0.5 * rows, 1.0])
    step = along[:2] / along[2] - middle[:2] / middle[2]
    zoom = float(np.hypot(*step))
    cos, sin = step / zoom
    layers = []
    for image in (*vision.enhancement, vision.valid.astype(np.float32)):
        seen = cv2.GaussianBlur(image, (0, 0), 0.35 * zoom) if zoom > 1.2 else image
        layers.append(
            cv2.warpPerspective(
                seen, to_pixel, (cols, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderValue=0.0
            )
        )
    dx, dy, weight = (np.asarray(layer, dtype=np.float32) for layer in layers)
    # derivatives turn with the frame
    out = np.stack([np.float32(cos) * dx + np.float32(sin) * dy, np.float32(cos) * dy - np.float32(sin) * dx])
    power = float((weight * (out**2).sum(axis=0)).sum()) / max(2.0 * float(weight.sum()), 1e-6)
    return np.asarray(out / np.float32(math.sqrt(max(power, 1e-12)))), weight


class DrawnLine:
    """A line as a camera would see it: three pictures of two derivatives, whole and by place.

    Attributes:
        whole: (3, 2, rows, cols) all places.
        places: (places, 3, 2, tall, wide) each by itself.
        corner: (places, 2) column and row where each picture begins in the line frame.
        gram: (3, 3) products of the whole pictures.
    """

    def __init__(self, line: FeltLine, belief: Floats | None = None) -> None:
        """Draw what is believed: mixtures where it is in doubt.

        Args:
            line: of touch.
            belief: (places, T) in place of the line's own.
        """
        from glyphs.opencv import cv2

        patches = line.basis.patches
        self.tall, self.wide = patches.shape[3:]
        shares = (line.belief if belief is None else belief).astype(np.float32)
        soft = np.einsum("kt,tbdrc->kbdrc", shares, patches)
        at = line.places_px()
        self.corner = np.floor(at).astype(int) - np.array([self.wide // 2, self.tall // 2])
        rest = at - np.floor(at)
        self.places = np.empty_like(soft)
        for k in range(soft.shape[0]):
            move = np.array([[1.0, 0.0, rest[k, 0]], [0.0, 1.0, rest[k, 1]]])
            for b in range(3):
                for d in range(2):
                    self.places[k, b, d] = cv2.warpAffine(soft[k, b, d], move, (self.wide, self.tall))
        self.shape = line.shape
        self.whole = np.zeros((3, 2, *self.shape), dtype=np.float32)
        for k, (c, r) in enumerate(self.corner):
            self.whole[:, :, r : r + self.tall, c : c + self.wide] += self.places[k]
        self.gram = np.einsum("bdrc,edrc->be", self.whole, self.whole, dtype=np.float64)
        self.inverse = np.linalg.inv(self.gram + 1e-3 * np.trace(self.gram) * np.eye(3))

    def light(self, answer: Floats) -> Floats:
        """Weights of the pictures that explain most of edges with these products with each picture."""
        return np.asarray(self.inverse @ answer)

    def lit(self, light: Floats) -> NDArray[np.float32]:
        """(2, rows, cols) the line in one light."""
        return np.asarray(np.einsum("bdrc,b->drc", self.whole, light.astype(np.float32)))

    def quality(self, edges: NDArray[np.float32], weight: NDArray[np.float32]) -> float:
        """Correlation of edges with the best-lit line where it has ink."""
        lit = self.lit(self.light(np.einsum("bdrc,drc->b", self.whole, edges, dtype=np.float64)))
        size = (lit**2).sum(axis=0)
        ink = (size > 0.02 * float(size.max(initial=0.0))) & (weight > 0.5)
        a, b = lit[:, ink].astype(np.float64), edges[:, ink].astype(np.float64)
        norm = math.sqrt(float((a**2).sum()) * float((b**2).sum()))
        return float((a * b).sum()) / norm if norm > 0.0 else 0.0
