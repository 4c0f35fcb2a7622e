"""Where the camera's picture lies on the plate: sight's edges laid over touch's.

Neither light nor polarity is known, so that only the sizes of edges are compared. From what the stage tells, from
matched characters, or from both fields being the same, the transform is followed from blurred maps to sharp ones
by the enhanced correlation coefficient (Evangelidis & Psarakis 2008, doi:10.1109/TPAMI.2008.113)::

    photo frame (x, y)  --plate_from_photo-->  plate frame (x, y)
        +-----------+            +---------------+
        |  K 7 B 2  |    --->    |   K  7  B  2  |   turned, scaled, in perspective
        +-----------+            +---------------+
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.camera.pose import mapped
from glyphs.surface.maps import EdgeMap
from recognition.box import Box
from recognition.frames import channels, is_edge_channel

GRID_HEIGHTS = 0.04
"""Pitch of the grid on which the maps are compared, character heights."""
BLURS_HEIGHTS = (0.25, 0.12, 0.06)
"""Standard deviations of the blurs, coarse to fine; from one step to the next a shift is known to about half of it."""
LEAST_OVERLAP = 0.4
"""Of touch's map, what the picture must show for a transform to be considered."""
LEAST_QUALITY, LEAST_FOR_STRETCH = 0.35, 0.5
"""Correlations below which the maps are not taken for the same part, and no more than shift and turn is sought.

Other parts of the same format reach 0.3 to 0.4 in dirt: the line is where it is, whatever it says."""
MOST_SCALE, MOST_SHEAR, MOST_PERSPECTIVE = 1.25, 0.12, 0.12
"""Change of scale, shear, and change of scale across touch's map, beyond which a correction is no camera's."""
EDGE_LIMIT = 3.0
"""Edges stronger than so many times the map's mean count no more than that."""

Floats = NDArray[np.float64]


class RegisterFailure(StrEnum):
    """Why sight was not laid over touch."""

    NOT_FOUND = "no transform brings the two edge maps together"
    POOR = "the edge maps hardly agree where the best transform puts them"


@dataclass(frozen=True, eq=False)
class Registration:
    """Sight to touch.

    Attributes:
        plate_from_photo: (3, 3) homography, photo frame to plate frame, mm, lower right element 1; the best start
            where nothing was found.
        quality: correlation of the sizes of edges, -1 to 1; 0 where they do not overlap.
        failure: None where it can be relied upon.
    """

    plate_from_photo: Floats
    quality: float
    failure: RegisterFailure | None = None

    def __post_init__(self) -> None:
        h = np.array(self.plate_from_photo, dtype=np.float64)
        if h.shape != (3, 3) or not np.isfinite(h).all() or abs(np.linalg.det(h)) < 1e-15:
            raise ValueError("plate_from_photo must be a finite, invertible 3 x 3 matrix")
        h.flags.writeable = False
        object.__setattr__(self, "plate_from_photo", h)

    def plate(self, x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[Floats, Floats]:
        """Plate frame of places in the photo frame."""
        return mapped(self.plate_from_photo, x_mm, y_mm)

    def photo(self, x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[Floats, Floats]:
        """Photo frame of places in the plate frame."""
        return mapped(np.asarray(np.linalg.inv(self.plate_from_photo), dtype=np.float64), x_mm, y_mm)

    def box(self, box: Box) -> Box:
        """Axis-parallel hull, in the plate frame, of a box of the photo frame."""
        x, y = self.plate(
            np.array([box.x0_mm, box.x1_mm, box.x1_mm, box.x0_mm]),
            np.array([box.y0_mm, box.y0_mm, box.y1_mm, box.y1_mm]),
        )
        return Box(float(x.min()), float(y.min()), float(x.max()), float(y.max()))


def register(
    touch: EdgeMap, vision: EdgeMap, *, height_mm: float, starts: Sequence[ArrayLike] | None = None
) -> Registration:
    """Lay the camera's edges over those felt.

    Args:
        touch: as felt, plate frame.
        vision: as seen (`recognition.vision_edges`), photo frame.
        height_mm: of the characters; sets the scales.
        starts: plate-from-photo transforms to begin from; both frames the same, as a stage has them, and `same_field`
            unless given. See `matched_boxes` for one from characters.

    Returns:
        The transform of the best correlation.

    Raises:
        ValueError: a height that is not positive.
    """
    if not (math.isfinite(height_mm) and height_mm > 0.0):
        raise ValueError(f"height_mm is {height_mm}; a character height is a positive number of mm")
    guessed = starts if starts is not None else (np.eye(3), same_field(touch, vision))
    tried = [np.asarray(s, dtype=np.float64) for s in guessed]
    pair = _Pair(touch, vision, GRID_HEIGHTS * height_mm)
    best: Registration | None = None
    for start in tried:
        found = _followed(pair, start, height_mm)
        if best is None or found.quality > best.quality:
            best = found
    assert best is not None
    return best


def same_field(touch: EdgeMap, vision: EdgeMap) -> Floats:
    """Both maps show the same: middle upon middle, width upon width."""
    scale = (touch.shape[1] * touch.pitch_mm) / (vision.shape[1] * vision.pitch_mm)
    there, here = _middle(touch), _middle(vision)
    shift = (there[0] - scale * here[0], there[1] - scale * here[1])
    return np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]], [0.0, 0.0, 1.0]])


def matched_boxes(touch: Sequence[Box], vision: Sequence[Box]) -> Floats | None:
    """The similarity that lays boxes of sight over those of touch, one for one; None with fewer than two.

    Least squares over the boxes' middles (Umeyama 1991, doi:10.1109/34.88573), without mirroring.

    Raises:
        ValueError: different numbers of boxes.
    """
    if len(touch) != len(vision):
        raise ValueError(f"{len(vision)} boxes seen for {len(touch)} felt; give the same characters of both")
    if len(touch) < 2:
        return None
    to, of = (
        np.array([[0.5 * (b.x0_mm + b.x1_mm), 0.5 * (b.y0_mm + b.y1_mm)] for b in boxes])
        for boxes in (touch, vision)
    )
    z = (of - of.mean(axis=0)) @ np.array([1.0, 1.0j])
    w = (to - to.mean(axis=0)) @ np.array([1.0, 1.0j])
    power = float((np.abs(z) ** 2).sum())
    turn = complex((z.conj() * w).sum()) / power if power > 0.0 else 0.0j
    if abs(turn) < 1e-9:
        return None
    linear = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
    out = np.eye(3)
    out[:2, :2] = linear
    out[:2, 2] = to.mean(axis=0) - linear @ of.mean(axis=0)
    return out


def edge_size(edges: EdgeMap) -> NDArray[np.float32]:
    """(rows, cols) size of the edges, direction and sign left out, none over `EDGE_LIMIT` means; 0 where not valid."""
    stack = channels(edges.enhancement, edges.directions)[is_edge_channel(edges.directions)]
    size = np.sqrt((stack.astype(np.float32) ** 2).sum(axis=0))
    size = np.where(edges.valid, size, np.float32(0.0))
    mean = float(size[edges.valid].mean()) if edges.valid.any() else 0.0
    return np.asarray(
        np.minimum(size / np.float32(max(mean, 1e-12)), np.float32(EDGE_LIMIT)), dtype=np.float32
    )


class _Pair:
    """Both maps as sizes of edges; touch's on the grid of comparison."""

    def __init__(self, touch: EdgeMap, vision: EdgeMap, grid_mm: float) -> None:
        self.grid_mm = grid_mm
        width, height = touch.shape[1] * touch.pitch_mm, touch.shape[0] * touch.pitch_mm
        self.shape = (max(8, round(height / grid_mm)), max(8, round(width / grid_mm)))
        x0, y0 = touch.origin_mm
        self.plate_from_grid = np.array([[grid_mm, 0.0, x0], [0.0, grid_mm, y0], [0.0, 0.0, 1.0]])
        self.touch_image, self.touch_valid = self._drawn(touch, np.eye(3))
        self.vision = vision

    def _drawn(
        self, edges: EdgeMap, plate_from_map: Floats
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(sizes, share valid) of a map on the grid."""
        from glyphs.opencv import cv2

        p, (x0, y0) = edges.pitch_mm, edges.origin_mm
        of_pixel = plate_from_map @ np.array([[p, 0.0, x0], [0.0, p, y0], [0.0, 0.0, 1.0]])
        to_pixel = np.linalg.inv(of_pixel) @ self.plate_from_grid
        zoom = math.sqrt(abs(np.linalg.det(to_pixel[:2, :2])))
        out = []
        for image in (edge_size(edges), edges.valid.astype(np.float32)):
            seen = cv2.GaussianBlur(image, (0, 0), 0.4 * zoom) if zoom > 1.2 else image
            out.append(
                cv2.warpPerspective(
                    seen,
                    to_pixel,
                    self.shape[::-1],
                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                    borderValue=0.0,
                )
            )
        return np.asarray(out[0]), np.asarray(out[1])

    def at(
        self, start: Floats, blur_px: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """(touch, sight, both valid), blurred over what is valid, sight where a transform puts it."""
        seen, shown = self._drawn(self.vision, start)
        both = (shown > 0.5) & (self.touch_valid > 0.5)
        return _blurred(self.touch_image, self.touch_valid, blur_px), _blurred(seen, shown, blur_px), both

    def quality(self, transform: Floats, blur_px: float) -> float:
        """Correlation of the two where both are valid; 0 with too little overlap."""
        a, b, both = self.at(transform, blur_px)
        if both.mean() < LEAST_OVERLAP:
            return 0.0
        x, y = a[both] - a[both].mean(), b[both] - b[both].mean()
        size = math.sqrt(float((x**2).sum()) * float((y**2).sum()))
        return float((x * y).sum()) / size if size > 0.0 else 0.0


def _blurred(image: NDArray[np.float32], share: NDArray[np.float32], blur_px: float) -> NDArray[np.float32]:
    from glyphs.opencv import cv2

    weight = cv2.GaussianBlur(share, (0, 0), blur_px)
    return np.asarray(cv2.GaussianBlur(image * share, (0, 0), blur_px) / np.maximum(weight, 0.05))


def _followed(pair: _Pair, start: Floats, height_mm: float) -> Registration:
    """From one start, coarse to fine; every step is kept only if it brings the maps closer."""
    from glyphs.opencv import cv2

    finest = BLURS_HEIGHTS[-1] * height_mm / pair.grid_mm
    held = start / start[2, 2]
    if pair.at(held, 1.0)[2].mean() < LEAST_OVERLAP:
        return Registration(held, 0.0, RegisterFailure.NOT_FOUND)
    quality = pair.quality(held, finest)
    steps = [(b, cv2.MOTION_EUCLIDEAN) for b in BLURS_HEIGHTS]
    steps += [(BLURS_HEIGHTS[-1], cv2.MOTION_AFFINE), (BLURS_HEIGHTS[-1], cv2.MOTION_HOMOGRAPHY)]
    for blur, motion in steps:
        if motion != cv2.MOTION_EUCLIDEAN and quality < LEAST_FOR_STRETCH:
            break  # dirt would be stretched over dirt
        tried = _stepped(pair, held, blur * height_mm / pair.grid_mm, motion)
        if tried is None:
            continue
        better = pair.quality(tried, finest)
        if better > quality and _plausible(tried @ np.linalg.inv(start), pair):
            held, quality = tried / tried[2, 2], better
    return Registration(held, quality, RegisterFailure.POOR if quality < LEAST_QUALITY else None)


def _stepped(pair: _Pair, held: Floats, blur_px: float, motion: int) -> Floats | None:
    """One fit of the correction that is left; None where it does not settle."""
    from glyphs.opencv import cv2

    felt, seen, both = pair.at(held, blur_px)
    warp = np.eye(3 if motion == cv2.MOTION_HOMOGRAPHY else 2, 3, dtype=np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-5)
    try:
        _, found = cv2.findTransformECC(felt, seen, warp, motion, criteria, both.astype(np.uint8), 1)
    except cv2.error:  # it runs away or meets a flat map
        return None
    full = np.eye(3)
    full[: warp.shape[0]] = found
    if not np.isfinite(full).all() or abs(np.linalg.det(full)) < 1e-6:
        return None
    # ECC takes felt pixels to seen ones; the way back is wanted
    grid = pair.plate_from_grid
    return np.asarray(grid @ np.linalg.inv(full) @ np.linalg.inv(grid) @ held)


def _plausible(change: Floats, pair: _Pair) -> bool:
    """Whether a correction in the plate frame is one that a camera asks for."""
    h = change / change[2, 2]
    rows, cols = pair.shape
    corner = pair.plate_from_grid @ np.array([[0, cols, cols, 0], [0, 0, rows, rows], [1, 1, 1, 1.0]])
    depth = h[2] @ corner
    if depth.min() <= 0.0 or depth.max() / depth.min() > 1.0 + MOST_PERSPECTIVE:
        return False
    middle = corner.mean(axis=1)
    w = float(h[2] @ middle)
    x, y = (h[:2] @ middle) / w
    # of the mapping in the middle
    linear = (h[:2, :2] - np.outer([x, y], h[2, :2])) / w
    sizes = np.linalg.svd(linear, compute_uv=False)
    within = sizes[0] <= MOST_SCALE and sizes[1] >= 1.0 / MOST_SCALE
    return bool(within and sizes[0] / sizes[1] <= 1.0 + MOST_SHEAR and np.linalg.det(linear) > 0.0)


def _middle(edges: EdgeMap) -> tuple[float, float]:
    (rows, cols), p, (x0, y0) = edges.shape, edges.pitch_mm, edges.origin_mm
    return (x0 + 0.5 * (cols - 1) * p, y0 + 0.5 * (rows - 1) * p)
