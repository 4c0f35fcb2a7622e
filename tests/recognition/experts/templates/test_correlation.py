"""Sums of stretches against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.experts.templates.correlation import add_stretches

FLOAT32 = 2e-5
"""Relative to the sum of magnitudes, of some twenty terms in single precision."""


@pytest.mark.parametrize("n_ink", [0, 1, 7, 8, 9, 19])
def test_stretches_are_added_whatever_their_number(n_ink: int) -> None:
    rng = np.random.default_rng(n_ink)
    flat, value = rng.normal(size=200).astype(np.float32), rng.normal(size=n_ink).astype(np.float32)
    at = rng.integers(0, 150, n_ink)
    total = np.ones(37, dtype=np.float32)
    add_stretches(total, 0, total.size, flat, at, value, 0, n_ink)
    expected = 1.0 + sum((float(v) * flat[a : a + 37] for v, a in zip(value, at, strict=True)), np.zeros(37))
    np.testing.assert_allclose(total, expected, atol=FLOAT32 * 10)
