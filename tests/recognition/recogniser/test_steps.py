"""Steps along a line and sums over their paths, against all paths written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from recognition.recogniser.ctc import count_belief, place_belief
from recognition.recogniser.steps import FLOOR, SHOWN, Steps

# --------------------------------------------------------------------------------------------------------------- ctc

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
    assert belief.log_evidence == pytest.approx(np.log(total), abs=EXACT)
    np.testing.assert_allclose(np.exp(belief.log_belief), marginal / total, atol=EXACT)
    np.testing.assert_allclose(np.exp(belief.log_belief).sum(axis=1), 1.0, atol=EXACT)
    assert (np.diff(belief.frame) > 0.0).all()
    counts = np.exp(count_belief(log[:, 0], log[:, 1:], most=frames))
    np.testing.assert_allclose(counts, length / length.sum(), atol=EXACT)


# ------------------------------------------------------------------------------------------------------------- steps

CHARS = "ABCDEFGH"
RARE = 2e-2
"""What characters that show nowhere could change: FLOOR at each of a dozen steps, many times over."""


def some(seed: int, *, frames: int = 12) -> Steps:
    """Beliefs in a few of the characters."""
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(4, 0.4), frames)
    shares = np.zeros((frames, len(CHARS)))
    shares[:, rng.permutation(len(CHARS))[:3]] = p[:, 1:]
    return Steps.of(p[:, 0], shares, CHARS, np.arange(frames) * 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_leaving_out_what_shows_nowhere_changes_nothing(seed: int) -> None:
    steps = some(seed)
    allowed = ("ABCD", "ABCDEFGH", "EFGH")
    table = np.array([[c in place for c in CHARS] for place in allowed])
    full = place_belief(steps.log_blank, steps.log_chars, table)
    short = steps.places(allowed)
    probable = np.exp(full.log_belief) > 1e-3
    np.testing.assert_allclose(
        np.exp(short.log_belief)[probable], np.exp(full.log_belief)[probable], atol=RARE
    )
    np.testing.assert_allclose(np.exp(short.log_belief).sum(axis=1), 1.0, atol=1e-9)
    assert np.isneginf(short.log_belief[~table]).all()
    # nothing that is allowed is ruled out
    assert np.isfinite(short.log_belief[table]).all()
    counts = count_belief(steps.log_blank, steps.log_chars)
    assert int(steps.count().argmax()) == int(counts.argmax())


def test_where_nothing_allowed_shows_all_of_it_is_kept() -> None:
    shares = np.zeros((3, len(CHARS)))
    shares[1, 0] = 1.0 - 1e-3
    steps = Steps.of(np.array([0.99, 1e-3, 0.99]), shares, CHARS, np.arange(3.0))
    belief = steps.places(("GH",))
    np.testing.assert_allclose(np.exp(belief.log_belief[0, -2:]), 0.5, atol=1e-9)
    assert belief.log_evidence < SHOWN


def test_no_place_is_no_belief() -> None:
    assert some(0).places(()) is None
    assert some(0, frames=2).places(("AB",) * 3) is None


def test_no_character_is_ruled_out_by_one_network() -> None:
    steps = some(3)
    assert steps.log_chars.min() >= np.log(FLOOR)
    assert steps.log_blank.min() >= np.log(FLOOR)
