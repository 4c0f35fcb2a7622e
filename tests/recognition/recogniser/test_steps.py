"""Steps along a line: what they leave to places, and the short cut past characters that show nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.recogniser.ctc import count_belief, place_belief
from recognition.recogniser.steps import FLOOR, SHOWN, Steps

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
    assert full is not None
    assert short is not None
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
    assert belief is not None
    np.testing.assert_allclose(np.exp(belief.log_belief[0, -2:]), 0.5, atol=1e-9)
    assert belief.log_evidence < SHOWN


def test_no_place_is_no_belief() -> None:
    assert some(0).places(()) is None
    assert some(0, frames=2).places(("AB",) * 3) is None


def test_no_character_is_ruled_out_by_one_network() -> None:
    steps = some(3)
    assert steps.log_chars.min() >= np.log(FLOOR)
    assert steps.log_blank.min() >= np.log(FLOOR)
