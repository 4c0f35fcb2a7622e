"""Dense correlation against sums written out, and what a correlation must leave alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.frames import LineImage
from recognition.match import SEARCH_PIXELS, SearchTemplates, dense_scores, search_templates, window_energy
from recognition.templates import TemplateSet
from whisker_array.whisker.array import ALL_DIRECTIONS

PITCH = 5.0 / SEARCH_PIXELS
FFT32 = 1e-4
"""Absolute, of a correlation: float32 transforms of some thousand pixels."""


@pytest.fixture(scope="module")
def search(templates: TemplateSet) -> SearchTemplates:
    return search_templates(templates, ALL_DIRECTIONS)


def image_of(layers: np.ndarray) -> LineImage:
    return LineImage(
        np.ascontiguousarray(layers, dtype=np.float32), PITCH, PITCH, (0.0, 0.0), 0.0, (0.0, 0.0)
    )


def noise(rows: int, cols: int, *, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(3, rows, cols))


def window(search: SearchTemplates, t: int) -> tuple[int, int, slice, slice]:
    """Half rows and half columns of a template's window, and where it lies in the patch."""
    hr, hc = search.half_rows, int(search.half_cols[t])
    mid_r, mid_c = (n // 2 for n in search.patches.shape[2:])
    return hr, hc, slice(mid_r - hr, mid_r + hr + 1), slice(mid_c - hc, mid_c + hc + 1)


def test_scores_are_the_correlation_written_out(search: SearchTemplates, templates: TemplateSet) -> None:
    layers = noise(30, 60, seed=0)
    dense = dense_scores(image_of(layers), templates, ALL_DIRECTIONS)
    rng = np.random.default_rng(1)
    for t in range(len(templates.chars)):
        hr, hc, rr, cc = window(search, t)
        template = search.patches[t][:, rr, cc].astype(np.float64)
        template = template - template.mean(axis=(1, 2), keepdims=True)
        for _ in range(6):
            r, c = int(rng.integers(hr, 30 - hr)), int(rng.integers(hc, 60 - hc))
            seen = layers[:, r - hr : r + hr + 1, c - hc : c + hc + 1]
            seen = seen - seen.mean(axis=(1, 2), keepdims=True)
            expected = (seen * template).sum() / np.sqrt((seen**2).sum() * (template**2).sum())
            assert dense.score[t, r, c] == pytest.approx(expected, abs=FFT32)
            assert dense.energy[t, r, c] == pytest.approx((seen**2).mean(), rel=1e-4)


def test_search_patches_are_mean_free_and_of_their_window(
    search: SearchTemplates, templates: TemplateSet
) -> None:
    for t in range(len(templates.chars)):
        _, _, rr, cc = window(search, t)
        inside = search.patches[t][:, rr, cc]
        # of values up to about 1
        np.testing.assert_allclose(inside.mean(axis=(1, 2)), 0.0, atol=1e-6)
        assert (search.patches[t] ** 2).sum() == pytest.approx((inside**2).sum(), rel=1e-6)
        assert search.norm[t] == pytest.approx(np.linalg.norm(inside.astype(np.float64)), rel=1e-6)


def test_a_narrow_template_has_a_narrow_window(search: SearchTemplates, templates: TemplateSet) -> None:
    by = dict(zip(templates.chars, search.half_cols, strict=True))
    assert by["1"] < by["K"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_template_itself_scores_one_and_its_negative_minus_one(
    sign: float, search: SearchTemplates, templates: TemplateSet
) -> None:
    rows, cols = search.patches.shape[2:]
    for t in range(len(templates.chars)):
        layers = np.zeros((3, rows + 10, cols + 20))
        layers[:, 4 : 4 + rows, 7 : 7 + cols] = sign * search.patches[t]
        at = (4 + rows // 2, 7 + cols // 2)
        score = dense_scores(image_of(layers), templates, ALL_DIRECTIONS).score
        assert score[t][at] == pytest.approx(sign, abs=FFT32)
        peak = np.unravel_index(int(np.argmax(sign * score[t])), score[t].shape)
        assert peak == at
        assert np.argmax(sign * score[:, *at]) == t


@settings(max_examples=20, deadline=None)
@given(scale=st.floats(0.01, 100.0), shift=st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3))
def test_scores_know_neither_depth_nor_level(
    templates: TemplateSet, scale: float, shift: list[float]
) -> None:
    layers = noise(28, 50, seed=2)
    plain = dense_scores(image_of(layers), templates, ALL_DIRECTIONS).score
    changed = scale * (layers + np.array(shift)[:, None, None])
    np.testing.assert_allclose(
        dense_scores(image_of(changed), templates, ALL_DIRECTIONS).score, plain, atol=5 * FFT32
    )


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_score_exceeds_one(templates: TemplateSet, seed: int) -> None:
    layers = noise(26, 44, seed=seed) * np.random.default_rng(seed).uniform(0.0, 1.0, (1, 26, 44)) ** 6
    score = dense_scores(image_of(layers), templates, ALL_DIRECTIONS).score
    assert np.abs(score).max() <= 1.0 + FFT32


def test_windows_that_leave_the_image_score_nothing(search: SearchTemplates, templates: TemplateSet) -> None:
    rows, cols = 30, 60
    score = dense_scores(image_of(noise(rows, cols, seed=3)), templates, ALL_DIRECTIONS).score
    for t in range(len(templates.chars)):
        hr, hc, _, _ = window(search, t)
        inside = np.zeros((rows, cols), dtype=bool)
        inside[hr : rows - hr, hc : cols - hc] = True
        assert not score[t][~inside].any()
        assert score[t][inside].all()


@pytest.mark.parametrize("shape", [(1, 1), (2, 60), (30, 2), (5, 5), (17, 12)])
def test_images_smaller_than_a_template_score_nothing(shape: tuple[int, int], templates: TemplateSet) -> None:
    dense = dense_scores(image_of(noise(*shape, seed=4)), templates, ALL_DIRECTIONS)
    assert dense.score.shape == (len(templates.chars), *shape)
    assert not dense.score.any()
    assert np.isfinite(dense.energy).all()


def test_bare_land_scores_nothing(templates: TemplateSet) -> None:
    dense = dense_scores(image_of(np.zeros((3, 30, 60))), templates, ALL_DIRECTIONS)
    assert not dense.score.any()
    assert not dense.energy.any()


def test_the_energy_of_a_window_is_its_sum_of_squares_about_the_mean() -> None:
    layers = noise(12, 15, seed=5).astype(np.float32) + np.float32(3.0)
    spread, count = window_energy(layers, 2, 3)
    assert count == 5 * 7 * 3
    for r, c in ((2, 3), (6, 7), (9, 11)):
        seen = layers[:, r - 2 : r + 3, c - 3 : c + 4].astype(np.float64)
        expected = ((seen - seen.mean(axis=(1, 2), keepdims=True)) ** 2).sum()
        # sums of 180 in double precision, differences of them
        assert spread[r, c] == pytest.approx(expected, rel=1e-9)
