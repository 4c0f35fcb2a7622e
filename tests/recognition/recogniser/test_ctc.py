"""Sums over paths against all paths written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from recognition.recogniser.ctc import count_belief, place_belief

EXACT = 1e-9
"""Sums of at most a few thousand products in double precision."""


def spelled(path: tuple[int, ...]) -> tuple[int, ...]:
    """Repeats, then blanks (0) struck out; characters from 0."""
    return tuple(s - 1 for s, _ in itertools.groupby(path) if s)


def written_out(
    p: NDArray[np.float64], allowed: NDArray[np.bool_]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Evidence, sums by place and character, and sums by length, over every path."""
    frames, classes = p.shape
    total, marginal, length = 0.0, np.zeros(allowed.shape), np.zeros(frames + 1)
    for path in itertools.product(range(classes), repeat=frames):
        weight = float(np.prod([p[t, s] for t, s in enumerate(path)]))
        text = spelled(path)
        length[len(text)] += weight
        if len(text) == allowed.shape[0] and all(allowed[k, c] for k, c in enumerate(text)):
            total += weight
            for k, c in enumerate(text):
                marginal[k, c] += weight
    return total, marginal, length


@pytest.mark.parametrize("seed", range(12))
def test_posteriors_are_those_of_all_paths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames, count, places = (int(rng.integers(*r)) for r in ((2, 7), (1, 4), (1, 4)))
    p = rng.dirichlet(np.full(count + 1, 0.5), frames)
    allowed = rng.random((places, count)) < 0.6
    allowed[np.arange(places), rng.integers(0, count, places)] = True
    total, marginal, length = written_out(p, allowed)
    with np.errstate(divide="ignore"):
        log = np.log(p)
    belief = place_belief(log[:, 0], log[:, 1:], allowed)
    if total == 0.0:
        assert belief is None
        return
    assert belief is not None
    assert belief.log_evidence == pytest.approx(np.log(total), abs=EXACT)
    np.testing.assert_allclose(np.exp(belief.log_belief), marginal / total, atol=EXACT)
    np.testing.assert_allclose(np.exp(belief.log_belief).sum(axis=1), 1.0, atol=EXACT)
    assert (np.diff(belief.frame) > 0.0).all()
    counts = np.exp(count_belief(log[:, 0], log[:, 1:], most=frames))
    np.testing.assert_allclose(counts, length / length.sum(), atol=EXACT)
