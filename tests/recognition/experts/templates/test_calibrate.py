"""Belief from scores: what must hold of any."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from recognition.experts.templates.calibrate import (
    DEFAULT_WEIGHTS,
    Scored,
    Weights,
    log_beliefs,
    residual_of,
)

IDEAL = np.full(4, 2000.0)


def scored(evidence: list[float], correlation: list[float] | None = None) -> Scored:
    r = np.zeros(len(evidence)) if correlation is None else np.array(correlation)
    return Scored(np.array(evidence), residual_of(r), np.full(len(evidence), 2000.0))


def evidences() -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float64, 4, elements=st.floats(-3000.0, 3000.0))


def correlations() -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float64, 4, elements=st.floats(-1.0, 1.0))


@given(evidences(), correlations())
def test_beliefs_are_probabilities_and_nothing_has_its_share(evidence: np.ndarray, r: np.ndarray) -> None:
    log = log_beliefs(Scored(evidence, residual_of(r), IDEAL))
    assert log.shape == (4,)
    assert np.isfinite(log).all()
    total = float(np.exp(log).sum())
    best = int(np.argmax(DEFAULT_WEIGHTS.evidence * evidence + DEFAULT_WEIGHTS.residual * residual_of(r)))
    explained = max(evidence[best] / 2000.0, 0.0)
    # worked out anew: half the doubt where the best explains `doubt_share`
    nothing = 0.9 / (1.0 + (explained / 0.15) ** 4)
    assert total == pytest.approx(1.0 - nothing, rel=1e-9)
    assert int(np.argmax(log)) == best or log[best] == log.max()


@given(evidences(), correlations(), st.integers(0, 3), st.floats(1.0, 500.0))
def test_a_characters_share_grows_with_its_evidence(
    evidence: np.ndarray, r: np.ndarray, which: int, more: float
) -> None:
    def share(values: np.ndarray) -> float:
        log = log_beliefs(Scored(values, residual_of(r), IDEAL))
        return float(np.exp(log[which] - np.logaddexp.reduce(log)))

    raised = evidence.copy()
    raised[which] += more
    assert share(raised) >= share(evidence) - 1e-12


@given(evidences(), correlations(), st.integers(0, 3), st.floats(0.0, 1.0))
def test_a_characters_share_grows_with_its_correlation(
    evidence: np.ndarray, r: np.ndarray, which: int, to: float
) -> None:
    def share(values: np.ndarray) -> float:
        log = log_beliefs(Scored(evidence, residual_of(values), IDEAL))
        return float(np.exp(log[which] - np.logaddexp.reduce(log)))

    better = r.copy()
    better[which] = max(r[which], to)
    assert share(better) >= share(r) - 1e-12


def test_without_slip_and_doubt_shares_are_a_logit() -> None:
    weights = Weights(evidence=0.01, residual=-2.0, doubt=0.0, slip=0.0)
    one = scored([300.0, 100.0, 0.0, -50.0], [0.9, 0.5, 0.0, 0.0])
    exponent = np.array([3.0, 1.0, 0.0, -0.5]) - 2.0 * np.log([0.19, 0.75, 1.0, 1.0])
    expected = np.exp(exponent) / np.exp(exponent).sum()
    np.testing.assert_allclose(np.exp(log_beliefs(one, weights)), expected, rtol=1e-12)


def test_where_nothing_is_explained_nothing_is_read() -> None:
    for none in ([0.0] * 4, [-500.0, -400.0, -900.0, -700.0]):
        assert np.exp(log_beliefs(scored(none))).sum() == pytest.approx(1.0 - DEFAULT_WEIGHTS.doubt)
    # as much as a clean mark explains leaves no doubt
    assert np.exp(log_beliefs(scored([2000.0, 0.0, 0.0, 0.0]))).sum() > 0.999
    half = [DEFAULT_WEIGHTS.doubt_share * 2000.0, 0.0, 0.0, 0.0]
    assert np.exp(log_beliefs(scored(half))).sum() == pytest.approx(1.0 - 0.5 * DEFAULT_WEIGHTS.doubt)


def test_nothing_is_surer_than_slip_allows() -> None:
    log = log_beliefs(scored([1e6, 0.0, 0.0, 0.0]))
    rest = np.exp(log)[1:]
    assert rest.min() >= 0.99 * DEFAULT_WEIGHTS.slip / 4
    assert rest.sum() < DEFAULT_WEIGHTS.slip


@given(st.floats(-1.0, 1.0))
def test_what_correlation_leaves(r: float) -> None:
    left = float(residual_of(np.array([r]))[0])
    assert np.log(1e-4) <= left <= 0.0
    if r <= 0.0:
        assert left == 0.0
    elif r < 0.999:
        assert np.exp(left) == pytest.approx(1.0 - r**2)


@pytest.mark.parametrize(
    "wrong",
    [
        {"evidence": 0.0},
        {"evidence": -0.01},
        {"evidence": float("nan")},
        {"residual": 0.1},
        {"residual": float("nan")},
        {"doubt": 1.0},
        {"doubt": -0.1},
        {"doubt_share": 0.0},
        {"slip": 0.5},
    ],
)
def test_weights_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"Weights"):
        Weights(**{"evidence": 0.01, "residual": -9.0, **wrong})
