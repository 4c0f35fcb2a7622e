"""Averaging by a triangle one pixel (or one step, if larger) wide to each side.

weight  1 |        .                 samples  x x x x x x x x x
          |      .' '.               pixels     |   |   |   |
        0 |____.'_____'._____        each pixel: the samples within reach, by their distance
             pixel +- reach
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def averaging(position: NDArray[Any], pixel: NDArray[Any], pitch: float) -> Any:
    """Sparse (pixels, samples) weights of samples for pixels; a triangle reaches one pitch, or one step if larger."""
    from scipy import sparse

    position, pixel = np.asarray(position, np.float64), np.asarray(pixel, np.float64)
    order = np.argsort(position, kind="stable")
    ordered = position[order]
    steps = np.sort(np.diff(ordered))
    step = float(0.5 * (steps[(steps.size - 1) // 2] + steps[steps.size // 2])) if steps.size else pitch
    reach = max(pitch, step) * (1.0 + 1e-6)
    begin, end = np.searchsorted(ordered, pixel - reach), np.searchsorted(ordered, pixel + reach)
    count = end - begin
    first = np.concatenate([[0], np.cumsum(count)])
    near = np.arange(first[-1]) + np.repeat(begin - first[:-1], count)
    weight = np.clip(1.0 - np.abs(np.repeat(pixel, count) - ordered[near]) / reach, 0.0, None)
    return sparse.csr_array((weight, order[near], first), shape=(pixel.size, position.size))


def spread(
    values: NDArray[np.float64], along: Any, across: Any
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(lines, samples) averaged onto (pixels across, pixels along) by `averaging` both ways.

    What is not finite is left out; valid where half of the weight or more is known, 0 where not.
    """
    known = np.isfinite(values)
    total = across @ (along @ np.where(known, values, 0.0).T).T
    weight = across @ (along @ known.T.astype(np.float64)).T
    expected = np.outer(across.sum(axis=1), along.sum(axis=1))
    valid = weight > 0.5 * expected
    return np.where(valid, total / np.maximum(weight, 1e-12), 0.0), valid
