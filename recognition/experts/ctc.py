"""What a recogniser's frames say of every place of a line, with the format inside the sum (exact, no beam).

A network that reads lines gives, frame by frame along the line, probabilities of characters and of a *blank*;
a path of frames spells the text that is left when repeats and then blanks are struck out (connectionist temporal
classification). For a known number of places the paths run through a small lattice of states::

    blank 0 -> place 1 -> blank 1 -> place 2 -> ... -> place n -> blank n
                   \\_________________/^   (two different characters may follow each other without a blank)

Every path belongs to one text only, so sums over paths are sums over texts: forward and backward sums give the
posterior of every character at every place among all texts that the format allows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

MOST_PLACES = 32
"""Places looked for where the format is not known."""


@dataclass(frozen=True, eq=False)
class PlaceBelief:
    """Posteriors of a line of a known number of places.

    Attributes:
        log_belief: (places, C) natural logarithms; each row sums to 1 in probability.
        log_evidence: of all texts allowed together.
        frame: (places,) where each place stands, in frames, mean of its posterior.
        spread: (places,) standard deviation of that, frames.
    """

    log_belief: NDArray[np.float64]
    log_evidence: float
    frame: NDArray[np.float64]
    spread: NDArray[np.float64]


@njit(cache=True)
def _add(a: float, b: float) -> float:
    """Log of the sum of two numbers given by their logs."""
    high, low = (a, b) if a > b else (b, a)
    if low == -np.inf:
        return high
    return high + math.log1p(math.exp(low - high))


@njit(cache=True)
def _all_and_others(values, powers, others):  # type: ignore[no-untyped-def]
    """Log of the sum; logs of the sums of all but each, from both ends: nothing is subtracted.

    `powers` is room for the exponentials.
    """
    count = values.size
    top = -np.inf
    for v in values:
        top = max(top, v)
    if top == -np.inf:
        others[:] = -np.inf
        return top
    before = 0.0
    for c in range(count):
        powers[c] = math.exp(values[c] - top) if values[c] > -np.inf else 0.0
        others[c] = before
        before += powers[c]
    after = 0.0
    for c in range(count - 1, -1, -1):
        rest = others[c] + after
        others[c] = top + math.log(rest) if rest > 0.0 else -np.inf
        after += powers[c]
    return top + math.log(before)


@njit(cache=True)
def _forward(blank, chars, allowed):  # type: ignore[no-untyped-def]
    """Log sums of paths that end in each state at each frame, and that enter each place then."""
    frames, count = chars.shape
    places = allowed.shape[0]
    at_blank = np.full((frames, places + 1), -np.inf)
    at_place = np.full((frames, places, count), -np.inf)
    enter = np.full((frames, places, count), -np.inf)
    powers, rest = np.empty(count), np.empty((places + 1, count))
    at_blank[0, 0] = blank[0]
    for c in range(count):
        if places > 0 and allowed[0, c]:
            enter[0, 0, c] = chars[0, c]
            at_place[0, 0, c] = chars[0, c]
    for t in range(1, frames):
        for k in range(places + 1):
            came = at_blank[t - 1, k]
            if k > 0:
                came = _add(came, _all_and_others(at_place[t - 1, k - 1], powers, rest[k]))
            at_blank[t, k] = came + blank[t]
        for k in range(places):
            for c in range(count):
                if not allowed[k, c]:
                    continue
                came = at_blank[t - 1, k]
                if k > 0:
                    came = _add(came, rest[k, c])
                enter[t, k, c] = came + chars[t, c]
                at_place[t, k, c] = _add(at_place[t - 1, k, c] + chars[t, c], enter[t, k, c])
    return at_blank, at_place, enter


@njit(cache=True)
def _backward(blank, chars, allowed):  # type: ignore[no-untyped-def]
    """Log sums of the ways on from each place at each frame."""
    frames, count = chars.shape
    places = allowed.shape[0]
    on_blank = np.full(places + 1, -np.inf)
    on_place = np.full((frames, places, count), -np.inf)
    on_blank[places] = 0.0
    rest = np.empty((places + 1, count))
    powers, step, total = np.empty(count), np.empty(count), np.empty(places + 1)
    on_place[frames - 1, places - 1] = 0.0
    for t in range(frames - 2, -1, -1):
        rest[:] = -np.inf
        total[:] = -np.inf
        for k in range(places):
            step[:] = -np.inf
            for c in range(count):
                if allowed[k, c]:
                    step[c] = chars[t + 1, c] + on_place[t + 1, k, c]
            total[k] = _all_and_others(step, powers, rest[k])
        for k in range(places):
            for c in range(count):
                if not allowed[k, c]:
                    continue
                way = _add(chars[t + 1, c] + on_place[t + 1, k, c], blank[t + 1] + on_blank[k + 1])
                on_place[t, k, c] = _add(way, rest[k + 1, c])
        for k in range(places + 1):
            on_blank[k] = _add(blank[t + 1] + on_blank[k], total[k])
    return on_place


def place_belief(
    log_blank: NDArray[np.float64], log_chars: NDArray[np.float64], allowed: NDArray[np.bool_]
) -> PlaceBelief | None:
    """Posteriors of every place over all texts of that many places.

    Args:
        log_blank: (frames,) log probability of the blank.
        log_chars: (frames, C) of each character; what the frames give to other characters is just missing.
        allowed: (places, C) which characters may stand where, at least one place.

    Returns:
        The posteriors; None where no text of the format is possible at all (fewer frames than places).
    """
    blank = np.ascontiguousarray(log_blank, dtype=np.float64)
    chars = np.ascontiguousarray(log_chars, dtype=np.float64)
    table = np.ascontiguousarray(allowed, dtype=np.bool_)
    at_blank, at_place, enter = _forward(blank, chars, table)
    evidence = float(np.logaddexp(at_blank[-1, -1], np.logaddexp.reduce(at_place[-1, -1])))
    if not np.isfinite(evidence):
        return None
    on_place = _backward(blank, chars, table)
    log_belief = np.logaddexp.reduce(enter + on_place, axis=0) - evidence
    held = np.exp(np.logaddexp.reduce(at_place + on_place, axis=2) - evidence)
    held /= held.sum(axis=0)
    t = np.arange(blank.size, dtype=np.float64)[:, None]
    frame = (t * held).sum(axis=0)
    spread = np.sqrt(((t - frame) ** 2 * held).sum(axis=0))
    return PlaceBelief(np.asarray(log_belief), evidence, np.asarray(frame), np.asarray(spread))


def count_belief(
    log_blank: NDArray[np.float64], log_chars: NDArray[np.float64], *, most: int = MOST_PLACES
) -> NDArray[np.float64]:
    """(most + 1,) log posterior of the number of characters, any of them allowed anywhere."""
    most = min(most, log_blank.size)
    table = np.ones((most, log_chars.shape[1]), dtype=np.bool_)
    at_blank, at_place, _ = _forward(
        np.ascontiguousarray(log_blank, dtype=np.float64),
        np.ascontiguousarray(log_chars, dtype=np.float64),
        table,
    )
    log = at_blank[-1].copy()
    log[1:] = np.logaddexp(log[1:], np.logaddexp.reduce(at_place[-1], axis=1))
    total = np.logaddexp.reduce(log)
    return np.asarray(log - total if np.isfinite(total) else log)
