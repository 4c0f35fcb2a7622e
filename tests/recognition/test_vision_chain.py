"""Sums over all settings of a line against all settings written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from recognition.vision_chain import GAP_REACH, Metrics, count_evidence, gap_log_prior, settle

EXACT = 1e-9
"""Sums of some thousand products in double precision."""
METRICS = Metrics(before=np.array([1, 2]), advance=np.array([2, 5]), pixels=4)
COLS = 9


def written_out(
    evidence: np.ndarray, allowed: np.ndarray, gap_heights: float | None
) -> tuple[float, np.ndarray]:
    """Evidence and sums by place and character over every choice of characters and columns."""
    low, log = gap_log_prior(METRICS, gap_heights=gap_heights)
    places, count = allowed.shape
    total, marginal = 0.0, np.zeros(allowed.shape)
    for text in itertools.product(range(count), repeat=places):
        if not all(allowed[k, c] for k, c in enumerate(text)):
            continue
        for columns in itertools.product(range(COLS), repeat=places):
            weight = 1.0 / COLS
            for k, (c, x) in enumerate(zip(text, columns, strict=True)):
                weight *= np.exp(evidence[c, x]) / allowed[k].sum()
                if k:
                    before = columns[k - 1] - METRICS.before[text[k - 1]] + METRICS.advance[text[k - 1]]
                    gap = x - METRICS.before[c] - before - low
                    weight *= np.exp(log[gap]) if 0 <= gap < log.size else 0.0
            total += weight
            for k, c in enumerate(text):
                marginal[k, c] += weight
    return total, marginal


@pytest.mark.parametrize("gap_heights", [None, 0.25])
@pytest.mark.parametrize("seed", range(4))
def test_posteriors_are_those_of_all_settings(seed: int, gap_heights: float | None) -> None:
    rng = np.random.default_rng(seed)
    evidence = rng.normal(0.0, 2.0, (2, COLS))
    allowed = np.array([[True, True], [True, False], [True, True]])[: 2 + seed % 2]
    total, marginal = written_out(evidence, allowed, gap_heights)
    found = settle(evidence, METRICS, allowed, gap_heights=gap_heights)
    assert found is not None
    assert found.log_evidence == pytest.approx(np.log(total), abs=EXACT)
    np.testing.assert_allclose(np.exp(found.log_belief), marginal / total, atol=EXACT)


def test_counting_agrees_with_settling() -> None:
    evidence = np.random.default_rng(5).normal(0.0, 2.0, (2, COLS))
    counts = count_evidence(evidence, METRICS, most=3)
    assert counts[0] == 0.0
    for n in (1, 2, 3):
        found = settle(evidence, METRICS, np.ones((n, 2), dtype=np.bool_))
        assert found is not None
        assert counts[n] == pytest.approx(found.log_evidence, abs=EXACT)


@pytest.mark.parametrize("gap_heights", [None, 0.3])
@pytest.mark.parametrize("wide", [False, True])
def test_a_spacing_is_a_distribution(gap_heights: float | None, wide: bool) -> None:
    low, log = gap_log_prior(METRICS, gap_heights=gap_heights, wide=wide)
    assert np.exp(log).sum() == pytest.approx(1.0, abs=EXACT)
    assert low == round(GAP_REACH[0] * METRICS.pixels)
