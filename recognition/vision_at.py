"""What the camera sees where touch has its characters: both edge maps asked about the same places.

Sight alone must find the line first, and in dirt that is where it fails. Touch knows the places; the camera's
edges, laid over them, are asked for every character there, pixel by pixel as far as they can be relied upon::

    reliability = share not clipped x usual clutter / clutter about the pixel

Clutter is what the line as believed leaves of the edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import EdgeMap
from recognition.tactile_line import DrawnLine, FeltLine, laid

SLACK_HEIGHTS = (0.06, 0.1)
"""Rows and columns by which a character may lie beside touch's place: registration, and ink that is not centred."""
CLUTTER_HEIGHTS = 0.25
"""Reach over which clutter is averaged, character heights."""
MOST_RELIABILITY = 1.5
ROUNDS = 2

Floats = NDArray[np.float64]


def vision_at(
    line: FeltLine, vision: EdgeMap, plate_from_photo: Floats, *, allowed: NDArray[np.bool_] | None = None
) -> Floats:
    """Log evidence of every character at every place of touch.

    The light is fitted to the line as believed: first by touch alone, then by both.

    Args:
        line: of touch.
        vision: signed edges, photo frame.
        plate_from_photo: (3, 3) homography.
        allowed: (places, T) characters that may stand there; all unless given.

    Returns:
        (places, T) natural logarithms of likelihood ratios against "no character".
    """
    look = line.basis.look
    slack_rows, slack_cols = (round(s * look.pixels) for s in SLACK_HEIGHTS)
    margin = max(slack_rows, slack_cols)
    edges, valid = laid(vision, plate_from_photo, line, margin=margin)
    table = np.ones(line.belief.shape, dtype=np.bool_) if allowed is None else allowed
    belief = np.where(table, line.belief, 0.0)
    belief /= np.maximum(belief.sum(axis=1, keepdims=True), 1e-300)
    flat = line.basis.patches.reshape(*line.basis.patches.shape[:2], -1).astype(np.float32)
    out = np.zeros(line.belief.shape)
    for _ in range(ROUNDS):
        drawn = DrawnLine(line, belief)
        inner = edges[:, margin : margin + line.shape[0], margin : margin + line.shape[1]]
        light = drawn.light(np.einsum("bdrc,drc->b", drawn.whole, inner, dtype=np.float64))
        seen = np.pad(drawn.lit(light), ((0, 0), (margin, margin), (margin, margin)))
        weight = valid * _reliability(edges - seen, valid, CLUTTER_HEIGHTS * look.pixels)
        pictures = np.einsum("tbn,b->tn", flat, light.astype(np.float32))
        power = (pictures**2).reshape(pictures.shape[0], 2, -1).sum(axis=1)
        for k, (c, r) in enumerate(drawn.corner):
            # what the neighbours are believed to look like is no evidence here
            own = np.pad(drawn.lit_place(light, k), ((0, 0), (margin, margin), (margin, margin)))
            rest = edges - (seen - own)
            windows = []
            for dr in range(margin - slack_rows, margin + slack_rows + 1):
                for dc in range(margin - slack_cols, margin + slack_cols + 1):
                    rows, cols = slice(r + dr, r + dr + drawn.tall), slice(c + dc, c + dc + drawn.wide)
                    windows.append((weight[rows, cols].ravel(), rest[:, rows, cols]))
            w = np.stack([a for a, _ in windows])
            x = np.stack([(a.reshape(drawn.tall, drawn.wide) * b).ravel() for a, b in windows])
            score = look.independence * (x @ pictures.T - 0.5 * w @ power.T).astype(np.float64)
            top = score.max(axis=0)
            out[k] = top + np.log(np.exp(score - top).mean(axis=0))
        both = np.where(table, np.log(np.maximum(line.belief, 1e-6)) + out, -np.inf)
        both -= both.max(axis=1, keepdims=True)
        belief = np.exp(both) / np.exp(both).sum(axis=1, keepdims=True)
    return out


def _reliability(
    rest: NDArray[np.float32], valid: NDArray[np.float32], reach_px: float
) -> NDArray[np.float32]:
    """(rows, cols) usual clutter over that about each pixel."""
    from scipy import ndimage

    power = ndimage.gaussian_filter((rest**2).sum(axis=0) * valid, reach_px)
    share = ndimage.gaussian_filter(valid, reach_px)
    clutter = power / np.maximum(share, 1e-3)
    usual = float(np.median(clutter[valid > 0.5])) if (valid > 0.5).any() else 1.0
    return np.asarray(np.minimum(usual / np.maximum(clutter, 1e-6), MOST_RELIABILITY), dtype=np.float32)
