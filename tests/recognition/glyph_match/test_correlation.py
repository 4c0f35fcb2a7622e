"""Correlation as its formula has it, and the steps that it makes."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.glyph_match.correlation import correlate, steps_of


def by_formula(image: np.ndarray, template: np.ndarray, *, least_felt: float) -> np.ndarray:
    rows, columns, _ = template.shape
    about = template - template.mean(axis=(0, 1))
    size = (about**2).sum()
    correlations = np.empty((image.shape[0] - rows + 1, image.shape[1] - columns + 1))
    for i, j in np.ndindex(*correlations.shape):
        window = image[i : i + rows, j : j + columns]
        window = window - window.mean(axis=(0, 1))
        correlations[i, j] = (about * window).sum() / np.sqrt(
            size * ((window**2).sum() + least_felt**2 * size)
        )
    return correlations


def test_correlations_are_those_of_the_formula() -> None:
    rng = np.random.default_rng(3)
    image = rng.normal(size=(14, 20, 4)).astype(np.float32)
    templates = rng.normal(size=(3, 7, 5, 4)).astype(np.float32)
    correlations = correlate(image, list(templates), least_felt=0.2)
    assert correlations.shape == (3, 8, 16)
    for one, template in zip(correlations, templates, strict=True):
        assert one == pytest.approx(by_formula(image, template, least_felt=0.2), abs=1e-4)


def test_steps_believe_in_the_character_whose_template_fits_and_in_nothing_where_none_does() -> None:
    cells = np.array([[0.95, 0.6, 0.5], [0.6, 0.93, 0.9], [0.1, 0.05, 0.0]])
    steps = steps_of(cells, "ABC", np.array([20.0, 45.0, 70.0]), chars="ABCD")
    places = np.exp(steps.log_chars[1::2])
    assert places[0, 0] > 0.99
    assert places[1, 1] > places[1, 2] > 0.001
    assert np.exp(steps.log_blank[[0, 2, 4, 5, 6]]) == pytest.approx(1.0, abs=0.01)
    assert steps.columns[1::2].tolist() == [20.0, 45.0, 70.0]
    assert int(steps.count().argmax()) == 2
