"""Sight laid over touch by the characters that touch has read.

What touch believes to stand at every place is drawn as a camera would see it, for any light (a weighted sum of
three pictures), and looked for in the camera's edges: dirt is of no account, as only edges of characters are asked.

    transform --edges laid into the line frame--> shifts, turns --best explained--> stretch along the line
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.surface.maps import EdgeMap
from recognition.register import RegisterFailure, Registration
from recognition.tactile_line import DrawnLine, FeltLine, laid

REACH_HEIGHTS = 0.4
"""How far the line is looked for, character heights."""
TURNS_DEG = tuple(0.5 * k for k in range(-4, 5))
STRETCH_HEIGHTS = 0.3
"""Shift of either end against the middle that stretch and perspective may make up, character heights."""
LEAST_EXPLAINED = 0.22
"""Correlation with the line on its ink from which it is found: lines of other texts reach 0.2 in the same format."""

Floats = NDArray[np.float64]


def register_line(line: FeltLine, vision: EdgeMap, starts: Sequence[ArrayLike]) -> Registration:
    """Look for the line in the picture.

    Args:
        line: as touch has it.
        vision: signed edges, photo frame.
        starts: (3, 3) plate-from-photo transforms to begin from.

    Returns:
        The transform that explains most; its quality is the correlation of the edges with the best-lit line.

    Raises:
        ValueError: no start.
    """
    if not starts:
        raise ValueError("give at least one transform to start from")
    drawn = DrawnLine(line)
    best: tuple[float, Floats] | None = None
    for start in starts:
        held = np.asarray(start, dtype=np.float64)
        for turns in (TURNS_DEG, (-0.25, 0.0, 0.25)):
            value, held = _shifted(line, drawn, vision, held, turns)
        if best is None or value > best[0]:
            best = (value, held)
    assert best is not None
    held = _stretched(line, drawn, vision, best[1])
    quality = drawn.quality(*laid(vision, held, line))
    if quality < LEAST_EXPLAINED:
        return Registration(held / held[2, 2], quality, RegisterFailure.POOR)
    return Registration(held / held[2, 2], quality)


def _shifted(
    line: FeltLine, drawn: DrawnLine, vision: EdgeMap, held: Floats, turns: Sequence[float]
) -> tuple[float, Floats]:
    """The best shift and turn about the line's middle."""
    from glyphs.opencv import cv2

    reach = round(REACH_HEIGHTS * line.basis.look.pixels)
    best, out = -math.inf, held
    for turn in turns:
        turned = _about_middle(line, math.radians(turn)) @ held
        edges, _ = laid(vision, turned, line, margin=reach)
        answer = np.zeros((3, 2 * reach + 1, 2 * reach + 1))
        for b in range(3):
            for d in range(2):
                answer[b] += cv2.matchTemplate(edges[d], drawn.whole[b, d], cv2.TM_CCORR)
        value = np.einsum("brc,be,erc->rc", answer, drawn.inverse, answer)
        row, col = np.unravel_index(int(value.argmax()), value.shape)
        if value[row, col] > best:
            best = float(value[row, col])
            du = col - reach + _between(value[row], int(col))
            dv = row - reach + _between(value[:, col], int(row))
            out = _moved_px(line, -du, -dv) @ turned
    return best, out


def _stretched(line: FeltLine, drawn: DrawnLine, vision: EdgeMap, held: Floats) -> Floats:
    """Take up what is left along the line: shifts of the places by a parabola, in both directions.

    Every place has its own map of evidence by shift; their sum along the parabola is what is sought.
    """
    from scipy import ndimage

    from glyphs.opencv import cv2

    if len(line.middle_mm) < 3:
        return held
    reach = round(STRETCH_HEIGHTS * line.basis.look.pixels)
    edges, _ = laid(vision, held, line, margin=reach)
    rows, cols = line.shape
    inner = edges[:, reach : reach + rows, reach : reach + cols]
    light = drawn.light(np.einsum("bdrc,drc->b", drawn.whole, inner, dtype=np.float64))
    maps = []
    for k, (c, r) in enumerate(drawn.corner):
        lit = np.einsum("bdrc,b->drc", drawn.places[k], light).astype(np.float32)
        window = edges[:, r : r + drawn.tall + 2 * reach, c : c + drawn.wide + 2 * reach]
        seen = sum(cv2.matchTemplate(window[d], lit[d], cv2.TM_CCORR) for d in range(2))
        maps.append(np.asarray(seen, dtype=np.float64))
    at = line.places_px()[:, 0]
    t = (at - at.mean()) / max(float(np.ptp(at)) / 2.0, 1e-9)
    terms = np.stack([np.ones_like(t), t, t * t])
    scale = sum(float(m.max()) for m in maps)

    def value(bend: Floats) -> float:
        du, dv = bend[:3] @ terms, bend[3:] @ terms
        total = sum(
            float(ndimage.map_coordinates(m, [[reach + dv[k]], [reach + du[k]]], order=1, mode="nearest")[0])
            for k, m in enumerate(maps)
        )
        # a camera stretches little: half a pixel at the ends is usual, some pixels are not
        return total - 0.01 * scale * float((bend[1:3] ** 2).sum() + (bend[4:] ** 2).sum()) / 4.0

    bend = np.zeros(6)
    best = value(bend)
    for step in (2.0, 1.0, 0.5, 0.25):
        for _ in range(3):
            before = best
            for axis in (0, 3, 1, 4, 2, 5):
                for sign in (1.0, -1.0):
                    tried = bend.copy()
                    tried[axis] += sign * step
                    got = value(tried)
                    if got > best:
                        bend, best = tried, got
            if best == before:
                break
    return _bent(line, terms, bend, held)


def _bent(line: FeltLine, terms: Floats, bend: Floats, held: Floats) -> Floats:
    """The homography nearest to what the places ask for, each moved as it is."""
    from glyphs.opencv import cv2

    px = line.places_px()
    seen = px + np.stack([bend[:3] @ terms, bend[3:] @ terms], axis=1)
    side = np.array([0.0, 0.5 * line.basis.look.pixels])
    of = np.concatenate([seen - side, seen + side])
    to = np.concatenate([px - side, px + side])
    change, _ = cv2.findHomography(of, to, 0)
    if change is None or not np.isfinite(change).all():
        return held
    frame = line.plate_from_line
    return np.asarray(frame @ change @ np.linalg.inv(frame) @ held)


def _moved_px(line: FeltLine, du: float, dv: float) -> Floats:
    frame = line.plate_from_line
    move = np.array([[1.0, 0.0, du], [0.0, 1.0, dv], [0.0, 0.0, 1.0]])
    return np.asarray(frame @ move @ np.linalg.inv(frame))


def _about_middle(line: FeltLine, angle: float) -> Floats:
    x, y = line.middle_mm.mean(axis=0)
    cos, sin = math.cos(angle), math.sin(angle)
    to = np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
    back = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, 1.0]])
    return np.asarray(to @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ back)


def _between(values: Floats, top: int) -> float:
    """Where between samples a parabola through the top and its neighbours is highest."""
    if not 0 < top < values.size - 1:
        return 0.0
    a, b, c = (float(v) for v in values[top - 1 : top + 2])
    bend = a - 2.0 * b + c
    return 0.0 if bend >= 0.0 else max(-0.5, min(0.5, 0.5 * (a - c) / bend))
