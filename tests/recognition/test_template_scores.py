"""Rewards of the search against their formula in whole arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.match import DenseScores
from recognition.template_scores import TemplateScores, depth_share

FLOAT32 = 1e-5
FLOOR, COST = 0.5, 0.03


@pytest.mark.parametrize("negative", [False, True])
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_rewards_are_width_times_share_times_what_the_score_is_worth(negative: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    score = rng.uniform(-1, 1, (4, 9, 20)).astype(np.float32)
    energy = rng.uniform(0, 2, (2, 9, 20)).astype(np.float32)
    dense = DenseScores(score=score, window=np.array([0, 1, 1, 0]), window_energy=energy)
    assert np.array_equal(dense.energy, energy[[0, 1, 1, 0]])
    width = rng.uniform(0.2, 1.0, 4)
    typical = np.percentile(dense.energy.max(axis=(0, 1)), 80.0)
    share = np.sqrt(np.clip(dense.energy / typical, 0.0, 1.0))
    np.testing.assert_allclose(depth_share(dense)[dense.window], share, atol=FLOAT32)
    signed = -score if negative else score
    expected = width[:, None, None] * share * (np.sign(signed) * signed**2 - FLOOR**2) - COST
    made = TemplateScores(dense, depth_share(dense), width, negative=negative, score_floor=FLOOR, cost=COST)
    np.testing.assert_allclose(made.near(2, 7), expected[:, 2:7], atol=FLOAT32)
    promise = np.maximum(expected, 0.0).max(axis=0).sum(axis=1)
    np.testing.assert_allclose(made.promises(), promise, atol=20 * FLOAT32)
