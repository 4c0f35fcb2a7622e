"""Posteriors of every place of a line from a recogniser's frames, with the format inside the sum (exact, no beam).

A network that reads lines gives, frame by frame along the line, probabilities of characters and of a *blank*;
a path of frames spells the text that is left when repeats and then blanks are removed (connectionist temporal
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
from numpy.typing import NDArray

from glyphs.compiled import kernel


@dataclass(frozen=True, eq=False)
class PlaceBelief:
    """Posteriors of a line of a known number of places, (places, C); a row sums to 1 in probability."""

    log_belief: NDArray[np.float64]
    log_evidence: float
    frame: NDArray[np.float64]
    spread: NDArray[np.float64]


@kernel()
def _add(a: float, b: float) -> float:
    high, low = (a, b) if a > b else (b, a)
    if low == -np.inf:
        return high
    return high + math.log1p(math.exp(low - high))


@kernel()
def _part(a: float, b: float) -> float:
    return math.exp(a - b) if a > -np.inf else 0.0


@kernel()
def _all_and_others(values, others):  # type: ignore[no-untyped-def]
    before, after = 0.0, 0.0
    for c in range(values.size):
        others[c] = before
        before += values[c]
    for c in range(values.size - 1, -1, -1):
        others[c] += after
        after += values[c]
    return before


@kernel()
def _forward(blank, shares, allowed):  # type: ignore[no-untyped-def]
    """Sums of paths that end in each state at each frame, and of those that enter each place there, stored as shares of
    `exp(scale)`: so no path underflows, and no exponential is needed per character."""
    frames, count = shares.shape
    places = allowed.shape[0]
    at_blank = np.full((frames, places + 1), -np.inf)
    scale = np.full((frames, places), -np.inf)
    at_place, enter = np.zeros((frames, places, count)), np.zeros((frames, places, count))
    others_sum, total = np.zeros((places + 1, count)), np.full(places + 1, -np.inf)
    at_blank[0, 0] = blank[0]
    for t in range(frames):
        for k in range(places):
            came, same = (0.0 if k == 0 else -np.inf), -np.inf
            if t > 0:
                came, same = at_blank[t - 1, k], scale[t - 1, k]
            other = scale[t - 1, k - 1] if t > 0 and k > 0 else -np.inf
            top = max(came, same, other)
            if top == -np.inf:
                continue
            by_blank, stay, by_other = _part(came, top), _part(same, top), _part(other, top)
            most = 0.0
            for c in range(count):
                if allowed[k, c]:
                    enter[t, k, c] = (by_blank + by_other * others_sum[k, c]) * shares[t, c]
                    at_place[t, k, c] = enter[t, k, c]
                    if t > 0:
                        at_place[t, k, c] += stay * at_place[t - 1, k, c] * shares[t, c]
                    most = max(most, at_place[t, k, c])
            if most > 0.0:
                scale[t, k] = top + math.log(most)
                for c in range(count):
                    enter[t, k, c] /= most
                    at_place[t, k, c] /= most
        for k in range(places + 1):
            if t > 0:
                at_blank[t, k] = _add(at_blank[t - 1, k], total[k]) + blank[t]
        for k in range(1, places + 1):
            of_all = _all_and_others(at_place[t, k - 1], others_sum[k])
            total[k] = scale[t, k - 1] + math.log(of_all) if of_all > 0.0 else -np.inf
    return at_blank, at_place, enter, scale, total


def place_belief(
    log_blank: NDArray[np.float64], log_chars: NDArray[np.float64], allowed: NDArray[np.bool_]
) -> PlaceBelief | None:
    """Posteriors of every place over all texts with a given number of places; None if no text is possible."""
    inputs = _as_inputs(log_blank, log_chars)
    table = np.ascontiguousarray(allowed, dtype=np.bool_)
    at_blank, at_place, enter, scale, total = _forward(*inputs, table)
    evidence = float(np.logaddexp(at_blank[-1, -1], total[-1]))
    if not np.isfinite(evidence):
        return None
    # the paths onwards from each place are those that end there if frames and places are reversed
    blank, shares = inputs
    _, from_end, _, end_scale, _ = _forward(blank[::-1].copy(), shares[::-1].copy(), table[::-1].copy())
    # each frame counts once: it is left out of the paths onwards
    onwards = from_end[::-1, ::-1] / np.maximum(shares, 1e-300)[:, None]
    weight = np.exp(scale + end_scale[::-1, ::-1] - evidence)
    with np.errstate(divide="ignore"):
        log_belief = np.log(np.einsum("tkc,tkc,tk->kc", enter, onwards, weight))
    held = np.einsum("tkc,tkc->tk", at_place, onwards) * weight
    held /= held.sum(axis=0)
    t = np.arange(log_blank.size, dtype=np.float64)[:, None]
    frame = (t * held).sum(axis=0)
    spread = np.sqrt(((t - frame) ** 2 * held).sum(axis=0))
    return PlaceBelief(np.asarray(log_belief), evidence, np.asarray(frame), np.asarray(spread))


def count_belief(
    log_blank: NDArray[np.float64], log_chars: NDArray[np.float64], *, most: int = 32
) -> NDArray[np.float64]:
    """(most + 1,) log posterior of the number of characters, any of them allowed anywhere."""
    most = min(most, log_blank.size)
    table = np.ones((most, log_chars.shape[1]), dtype=np.bool_)
    at_blank, *_, total = _forward(*_as_inputs(log_blank, log_chars), table)
    log = np.logaddexp(at_blank[-1], total)
    whole = np.logaddexp.reduce(log)
    return np.asarray(log - whole if np.isfinite(whole) else log)


def _as_inputs(
    log_blank: NDArray[np.float64], log_chars: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.ascontiguousarray(log_blank, dtype=np.float64), np.exp(log_chars, dtype=np.float64, order="C")
