"""Reliefs of one character laid over each other: small shifts and turns, and what most of them have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

AGREEMENT, FALL = 0.75, 0.08
"""Correlation with its siblings that a relief must have, and by how much it may fall short of their usual one: blows
of one die reach 0.93 to 0.99, worn or soiled ones less, look-alikes (O and 0) 0.9 at most."""
SHIFT_PIXELS, TURNS_DEG = 3, (-3.0, -1.5, 0.0, 1.5, 3.0)
ROUNDS = 2
LEADERS = 7
"""Most siblings among which the one most like the others is sought."""

Patch = NDArray[np.float32]


def likeness(one: Patch, other: Patch) -> float:
    """Correlation of two reliefs as they lie."""
    a, b = one - one.mean(), other - other.mean()
    return float((a * b).sum() / max(float(np.sqrt((a * a).sum() * (b * b).sum())), 1e-12))


def align_relief(patch: Patch, reference: Patch) -> tuple[float, Patch]:
    """Best correlation of a relief with another over small shifts and turns, and the relief so moved."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    n = SHIFT_PIXELS
    inner = np.ascontiguousarray(reference[n:-n, n:-n], dtype=np.float32)
    best = (-2.0, 0, 0)
    moved = patch
    for turn in TURNS_DEG:
        turned = ndimage.rotate(patch, turn, reshape=False, order=1, mode="constant") if turn else patch
        score = cv2.matchTemplate(np.asarray(turned, dtype=np.float32), inner, cv2.TM_CCOEFF_NORMED)
        down, right = divmod(int(np.argmax(score)), 2 * n + 1)
        if score[down, right] > best[0]:
            best, moved = (float(score[down, right]), down, right), turned
    score_, down, right = best
    moved = ndimage.shift(moved, (n - down, n - right), order=0, mode="constant")
    return score_, np.asarray(moved, dtype=np.float32)


def common_relief(patches: Sequence[Patch]) -> tuple[Patch, list[int]]:
    """The median of those reliefs that agree, and which these are; of two that do not, the first alone."""
    if len(patches) == 1:
        return patches[0], [0]
    leaders = list(patches[:LEADERS])
    table = np.array(
        [[align_relief(q, p)[0] if p is not q else np.nan for q in leaders] for p in leaders],
        dtype=np.float64,
    )
    reference = leaders[int(np.argmax(np.nanmedian(table, axis=1)))]
    agree: list[int] = []
    for _ in range(ROUNDS):
        laid = [align_relief(p, reference) for p in patches]
        usual = float(np.median([score for score, _ in laid]))
        agree = [k for k, (score, _) in enumerate(laid) if score >= max(AGREEMENT, usual - FALL)]
        if len(agree) < 2:
            return patches[0], [0]
        stack = np.stack([laid[k][1] for k in agree])
        middle = np.median(stack, axis=0) if len(agree) > 2 else stack.mean(axis=0)
        reference = np.asarray(middle, dtype=np.float32)
    return reference, agree
