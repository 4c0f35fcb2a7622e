"""Averaging by a triangle one pixel wide to each side, or as wide as the next sample is away, if that is further.

weight  1 |        .                 samples  x x x x x x x x x
          |      .' '.               pixels     |   |   |   |
        0 |____.'_____'._____        each pixel: the samples within reach, by their distance
             pixel +- reach
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def averaging_weights(
    position: NDArray[Any], pixel: NDArray[Any], pitch: float, *, bridged: float = 2.1
) -> Any:
    """Sparse (pixels, samples) weights of samples for pixels.

    A triangle reaches one pitch to either side, or to the neighbouring sample if that is further away: so samples of
    uneven distance are joined by straight lines. A gap of more than `bridged` usual steps stays open: passes
    laid between passes leave some gaps twice as wide as others.
    """
    from scipy import sparse

    position, pixel = np.asarray(position, np.float64), np.asarray(pixel, np.float64)
    order = np.argsort(position, kind="stable")
    ordered = position[order]
    gaps = np.diff(ordered)
    steps = np.sort(gaps)
    step = float(0.5 * (steps[(steps.size - 1) // 2] + steps[steps.size // 2])) if steps.size else pitch
    # to the neighbour on either side; at the ends, and into a gap that stays open, as far as usual
    closed = np.where(gaps > bridged * step, step, gaps)
    apart = np.maximum(np.r_[step, closed, step], pitch) * (1.0 + 1e-6)
    begin = np.searchsorted(ordered + apart[1:], pixel)
    end = np.searchsorted(ordered - apart[:-1], pixel)
    count = np.maximum(end - begin, 0)
    first = np.concatenate([[0], np.cumsum(count)])
    near = np.arange(first[-1]) + np.repeat(begin - first[:-1], count)
    off = np.repeat(pixel, count) - ordered[near]
    weight = np.clip(1.0 - np.abs(off) / np.where(off > 0.0, apart[near + 1], apart[near]), 0.0, None)
    return sparse.csr_array((weight, order[near], first), shape=(pixel.size, position.size))


def average_onto(
    values: NDArray[np.float64], along: Any, across: Any
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(lines, samples) averaged onto (pixels across, pixels along) by `averaging_weights` both ways.

    Values that are not finite are left out; valid where half of the weight or more is known, 0 where not.
    """
    known = np.isfinite(values)
    total = across @ (along @ np.where(known, values, 0.0).T).T
    weight = across @ (along @ known.T.astype(np.float64)).T
    expected = np.outer(across.sum(axis=1), along.sum(axis=1))
    valid = weight > 0.5 * expected
    return np.where(valid, total / np.maximum(weight, 1e-12), 0.0), valid
