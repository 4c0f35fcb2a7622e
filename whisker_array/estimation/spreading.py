"""Averaging by a triangle one pixel (or one step, if larger) wide to each side, compiled.

weight  1 |        .                 samples  x x x x x x x x x
          |      .' '.               pixels     |   |   |   |
        0 |____.'_____'._____        each pixel: the samples within reach, by their distance
             pixel +- reach
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray


class Band(NamedTuple):
    """Weights of samples for pixels, a short run of samples for each.

    Attributes:
        first: (pixels + 1,) where the samples of each pixel begin in `sample` and `weight`.
        sample: indices of samples.
        weight: of each.
        samples: how many there are.
    """

    first: NDArray[np.int64]
    sample: NDArray[np.int64]
    weight: NDArray[np.float64]
    samples: int


def triangles(position: NDArray[np.float64], pixel: NDArray[np.float64], pitch: float) -> Band:
    """The band that averages samples at `position` onto pixels; a triangle reaches one pitch, or one step if larger."""
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
    return Band(first, order[near], weight, position.size)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _spread(values, along, across, layer, valid):  # type: ignore[no-untyped-def]
    a_first, a_sample, a_weight, _ = along
    c_first, c_sample, c_weight, _ = across
    lines, wide = values.shape[0], a_first.size - 1
    sums, known = np.empty((lines, wide)), np.empty((lines, wide))
    expected = np.zeros(wide)
    for p in range(wide):
        for k in range(a_first[p], a_first[p + 1]):
            expected[p] += a_weight[k]
    for i in range(lines):
        for p in range(wide):
            total = 0.0
            for k in range(a_first[p], a_first[p + 1]):
                total += a_weight[k] * values[i, a_sample[k]]
            weight = expected[p]
            if not np.isfinite(total):
                total = weight = 0.0
                for k in range(a_first[p], a_first[p + 1]):
                    value = values[i, a_sample[k]]
                    if np.isfinite(value):
                        total += a_weight[k] * value
                        weight += a_weight[k]
            sums[i, p], known[i, p] = total, weight
    total_of, weight_of = np.empty(wide), np.empty(wide)
    for p in range(c_first.size - 1):
        total_of[:] = 0.0
        weight_of[:] = 0.0
        full = 0.0
        for k in range(c_first[p], c_first[p + 1]):
            line, weight = c_sample[k], c_weight[k]
            full += weight
            for q in range(wide):
                total_of[q] += weight * sums[line, q]
                weight_of[q] += weight * known[line, q]
        for q in range(wide):
            good = weight_of[q] > 0.5 * full * expected[q]
            valid[p, q] = good
            layer[p, q] = total_of[q] / max(weight_of[q], 1e-12) if good else 0.0


def spread(
    values: NDArray[np.float64], along: Band, across: Band
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(lines, samples) averaged onto (pixels across, pixels along); valid where half of the weight or more is known.

    What is not finite is left out; 0 where not valid.
    """
    shape = (across.first.size - 1, along.first.size - 1)
    layer, valid = np.empty(shape), np.empty(shape, dtype=np.bool_)
    _spread(np.ascontiguousarray(values), along, across, layer, valid)
    return layer, valid
