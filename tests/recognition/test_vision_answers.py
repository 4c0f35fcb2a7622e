"""Products with pictures against sums over pixels; evidence and promise against numpy's plain formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from glyphs.fonts.glyph import Font
from recognition import vision_answers as vision_answers
from recognition.vision_answers import VisionAnswers, column_evidence, row_promise, spectra_of
from recognition.vision_templates import GLANCE, VisionBasis, predict_basis

SINGLE = 2e-5
"""Of the largest product: sums of some 1500 terms in single precision."""
EXACT = 1e-12
LIGHT = np.array([0.3, -0.6, 0.2])


@pytest.fixture(scope="module")
def basis(gothic: Font) -> VisionBasis:
    return predict_basis(gothic, "B17", look=GLANCE)


@pytest.fixture(scope="module")
def edges() -> np.ndarray:
    return np.random.default_rng(0).normal(0.0, 1.0, (2, 45, 83)).astype(np.float32)


@pytest.fixture(scope="module")
def plain(basis: VisionBasis, edges: np.ndarray) -> np.ndarray:
    """(3, cols, T, rows) products by scipy, in double precision and without spectra."""
    made = [
        [
            sum(
                signal.correlate(e.astype(np.float64), p.astype(np.float64), mode="same", method="direct")
                for e, p in zip(edges, picture, strict=True)
            )
            for picture in character
        ]
        for character in basis.patches
    ]
    return np.array(made).transpose(1, 3, 0, 2)


def test_products_are_sums_over_pixels(basis: VisionBasis, edges: np.ndarray, plain: np.ndarray) -> None:
    answers = VisionAnswers(edges, basis)
    largest = abs(plain).max()
    np.testing.assert_allclose(answers.pictures(0, 45), plain, atol=SINGLE * largest)
    np.testing.assert_allclose(answers.pictures(20, 25), plain[..., 20:25], atol=SINGLE * largest)
    lit = np.tensordot(LIGHT, plain, axes=1)
    np.testing.assert_allclose(answers.lit(LIGHT), lit, atol=SINGLE * largest)


def test_spectra_are_kept_within_bounds(gothic: Font, monkeypatch: pytest.MonkeyPatch) -> None:
    basis = predict_basis(gothic, "1", look=GLANCE)
    first = spectra_of(basis, 64)
    assert spectra_of(basis, 64) is first
    monkeypatch.setattr(vision_answers, "MOST_KEPT_BYTES", 8 * first.nbytes)
    for length in (96, 128, 160, 192):
        spectra_of(basis, length)
    # the oldest goes
    assert list(basis.work) == [("spectra", n) for n in (128, 160, 192)]


@pytest.mark.parametrize("squared", [True, False])
@pytest.mark.parametrize("strength", [0.1, 3.0, 200.0])
def test_evidence_is_the_mean_over_rows(strength: float, squared: bool) -> None:
    rng = np.random.default_rng(1)
    near = rng.normal(0.0, strength, (3, 20, 4, 5)).astype(np.float32)
    power, independence = rng.uniform(1.0, 9.0, 4), 0.25
    evidence, score = column_evidence(near, LIGHT, power, independence, squared=squared)
    lit = np.einsum("bxtr,b->txr", near.astype(np.float64), LIGHT)
    over = power[:, None, None]
    of_any_strength = 0.5 * np.maximum(lit, 0.0) ** 2 / over
    expected = independence * (of_any_strength if squared else lit - 0.5 * over)
    np.testing.assert_allclose(score, expected, rtol=EXACT, atol=EXACT)
    mean = np.logaddexp.reduce(expected, axis=2) - np.log(5)
    np.testing.assert_allclose(evidence, mean, rtol=EXACT, atol=EXACT)


def test_promise_is_of_the_best_character() -> None:
    rng = np.random.default_rng(2)
    answers = rng.normal(0.0, 1.0, (3, 30, 5, 12)).astype(np.float32)
    scale = rng.normal(0.0, 1.0, (4, 5, 3))
    scale[:, 2] = 0.0
    lit = np.einsum("bxtr,ntb->nxtr", answers, scale)
    expected = (np.maximum(lit.max(axis=2), 0.0) ** 2).mean(axis=1)
    # sums of three terms in single precision
    np.testing.assert_allclose(row_promise(answers, scale), expected, rtol=1e-5)
