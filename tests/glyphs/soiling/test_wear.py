"""Wear: what the tools take, what they leave, and where the metal goes."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from glyphs.soiling.coat import Coat
from glyphs.soiling.wear import rubbing as wear
from glyphs.soiling.wear.bench import on_bench
from glyphs.soiling.wear.blows import MOST_HITS, dimples, knock, peen
from glyphs.soiling.wear.rubbing import wear as worn
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

_coat = partial(bare_part, "H8", seed=1, varied=False)


def _rubbed(coat: Coat, amount: float, *, soft: float) -> Field:
    life = wear._Life(rubbed=1.0, peened=0.0, knocked=0.0, soft=soft, crossed=0.0)
    z, _ = wear._rub(on_bench(coat), coat.z_mm, amount, life, rng=np.random.default_rng(0))
    return z


@pytest.mark.parametrize("soft", [0.0, 1.0])
def test_rubbing_lowers_the_land_and_leaves_the_floor(soft: float) -> None:
    coat = _coat()
    taken = coat.z_mm - _rubbed(coat, 0.4, soft=soft)
    deep = on_bench(coat).deep_mm
    floor = coat.z_mm < -0.95 * deep
    land = coat.z_mm > -0.05 * deep
    assert taken[floor].max() < 0.02 * deep
    # 0.4 of 0.72 to 1.17 depths
    assert 0.25 * deep < np.median(taken[land]) < 0.5 * deep
    assert taken.min() >= -1e-6


def test_raised_marks_go_before_their_land() -> None:
    coat = _coat(raised=True)
    taken = coat.z_mm - _rubbed(coat, 0.4, soft=0.0)
    deep = on_bench(coat).deep_mm
    assert np.median(taken[coat.z_mm > 0.9 * deep]) > 0.2 * deep
    assert np.median(taken[coat.z_mm < 0.1 * deep]) < 0.02 * deep


def test_a_file_scores_and_a_buff_does_not() -> None:
    coat = _coat()
    deep = on_bench(coat).deep_mm
    rows = slice(0, coat.shape[0] // 8)  # land over the characters
    file, buff = (np.diff(_rubbed(coat, 0.5, soft=soft)[rows], axis=0).std() for soft in (0.0, 1.0))
    assert file > 3.0 * buff
    scored = _rubbed(coat, 0.5, soft=0.0)[rows]
    # a score is at most 0.7 of a depth
    assert 0.05 * deep < np.ptp(scored) < deep


def test_peening_moves_metal_and_takes_none() -> None:
    coat = _coat()
    z, hit = peen(on_bench(coat), coat.z_mm, 0.8, rng=np.random.default_rng(2))
    moved = z - coat.z_mm
    # what crosses the border of the plate is lost to the sum: a tenth of what moved is room for it
    assert abs(moved.sum()) < 0.1 * np.abs(moved).sum()
    deep = on_bench(coat).deep_mm
    groove = coat.z_mm < -0.5 * deep
    assert moved[groove].mean() > 0.1 * deep
    assert moved[~groove].mean() < 0.0
    assert 0.0 <= hit.min() <= hit.max() <= 1.0


@pytest.mark.parametrize("amount", [0.3, 0.6, 1.0])
def test_dents_cover_as_random_hits_do(amount: float) -> None:
    """1 - exp(-k), with k growing as the time of blasting until 0.9."""
    coat = _coat()
    cover = np.mean([(dimples(coat, amount, np.random.default_rng(s)) > 0.0).mean() for s in range(12)])
    assert cover == pytest.approx(1.0 - np.exp(-MOST_HITS * min(amount / 0.9, 1.0)), abs=0.08)


def test_knocks_pile_metal_up_beside_them() -> None:
    coat = _coat()
    z, _ = knock(on_bench(coat), coat.z_mm, 0.7, rng=np.random.default_rng(4))
    up, down = np.maximum(z - coat.z_mm, 0.0).sum(), np.maximum(coat.z_mm - z, 0.0).sum()
    assert 0.15 * down < up < down


def test_worn_metal_is_as_hard_as_the_part_and_bright() -> None:
    clean, used = _coat(), worn(_coat(), 0.8, rng=np.random.default_rng(5))
    assert not used.soft_mm.any()
    np.testing.assert_array_equal(used.hardness_mpa, clean.hardness_mpa)
    fresh = clean.z_mm - used.z_mm > 0.3 * on_bench(clean).deep_mm
    assert fresh.mean() > 0.1
    assert used.albedo[fresh].mean() > clean.albedo[fresh].mean()
    assert used.reflectance[fresh].mean() > clean.reflectance[fresh].mean()
