"""Residuals about a level that walks."""

from __future__ import annotations

import numpy as np
import pytest

from whisker_array.identification.residuals import START_ERROR, WALK, innovations

SCATTER, SAMPLES, LINES = 0.02, 400, 200


def missed(seed: int) -> np.ndarray:
    """(samples, lines) scatter about levels that walk as the module says."""
    rng = np.random.default_rng(seed)
    steps = WALK * SCATTER * rng.standard_normal((SAMPLES, LINES))
    steps[0] = START_ERROR * SCATTER * rng.standard_normal(LINES)
    return np.cumsum(steps, axis=0) + SCATTER * rng.standard_normal((SAMPLES, LINES))


def test_innovations_of_such_a_level_scatter_by_one_and_know_nothing_of_each_other() -> None:
    """80,000 samples: a correlation scatters by 0.0035, a variance by 0.005; four times that."""
    sigma = np.full(SAMPLES, SCATTER)
    left = innovations(missed(1), sigma, scatter=SCATTER)
    assert np.var(left) == pytest.approx(1.0, abs=0.02)
    for apart in (1, 2, 10, 50):
        assert np.mean(left[apart:] * left[:-apart]) == pytest.approx(0.0, abs=0.014)


def test_a_sample_that_is_not_used_says_nothing() -> None:
    sigma = np.full(SAMPLES, SCATTER)
    sigma[100:110] = np.inf
    values, other = missed(4), missed(4)
    other[100:110] += 1e3
    left, same = (innovations(v, sigma, scatter=SCATTER) for v in (values, other))
    np.testing.assert_array_equal(left, same)
    assert not left[100:110].any()
