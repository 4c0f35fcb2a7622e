"""Averaging by a triangle one pixel (or one step, if larger) wide to each side.

weight  1 |        .                 samples  x x x x x x x x x
          |      .' '.               pixels     |   |   |   |
        0 |____.'_____'._____        each pixel: the samples within reach, by their distance
             pixel +- reach
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel, read_only


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


@kernel()
def _along(values, first, sample, weight, expected, sums, known):  # type: ignore[no-untyped-def]
    """Sums by pixel along each line of what is known, and their weights."""
    for i in range(values.shape[0]):
        for p in range(expected.size):
            total = 0.0
            for k in range(first[p], first[p + 1]):
                total += weight[k] * values[i, sample[k]]
            whole = expected[p]
            if not abs(total) < np.inf:
                total = whole = 0.0
                for k in range(first[p], first[p + 1]):
                    value = values[i, sample[k]]
                    if abs(value) < np.inf:
                        total += weight[k] * value
                        whole += weight[k]
            sums[i, p], known[i, p] = total, whole


@kernel()
def _across(sums, known, first, sample, weight, expected, layer, weights, valid):  # type: ignore[no-untyped-def]
    """Those sums averaged across the lines; `weights` is room for one line."""
    wide = expected.size
    for p in range(first.size - 1):
        out = layer[p]
        for q in range(wide):
            out[q] = weights[q] = 0.0
        full = 0.0
        for k in range(first[p], first[p + 1]):
            w, line, part = weight[k], sums[sample[k]], known[sample[k]]
            full += w
            for q in range(wide):
                out[q] += w * line[q]
                weights[q] += w * part[q]
        for q in range(wide):
            good = weights[q] > 0.5 * full * expected[q]
            valid[p, q] = good
            out[q] = out[q] / max(weights[q], 1e-12) if good else 0.0


def spread(
    values: NDArray[np.float64], along: Band, across: Band
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(lines, samples) averaged onto (pixels across, pixels along); valid where half of the weight or more is known.

    What is not finite is left out; 0 where not valid.
    """
    shape = (across.first.size - 1, along.first.size - 1)
    layer, valid = np.empty(shape), np.empty(shape, dtype=np.bool_)
    pixel = np.repeat(np.arange(shape[1]), np.diff(along.first))
    expected = np.bincount(pixel, weights=along.weight, minlength=shape[1])
    sums, known = np.empty((2, values.shape[0], shape[1]))
    _along(read_only(values), along.first, along.sample, along.weight, expected, sums, known)
    _across(
        sums, known, across.first, across.sample, across.weight, expected, layer, np.empty(shape[1]), valid
    )
    return layer, valid
