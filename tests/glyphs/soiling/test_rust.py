"""Rust's physics: one account of steel and oxide, pits, laminas, packed marks, what yields, how it looks."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.soiling.coat import Coat
from glyphs.soiling.rust.corrosion import draw_pits, mark_depth_mm, rust
from tests.support.coats import bare_part

SEEDS = range(5)


def _rusted(amount: float, seed: int = 0, raised: bool = False) -> Coat:
    return rust(bare_part(raised=raised), amount, rng=np.random.default_rng(seed))


def _contrast(coat: Coat) -> float:
    """How far the marks stand out from the land as they did when clean, 1 when clean: slope of a fit."""
    clean = coat.clean_mm - coat.brim_mm
    now = coat.z_mm - coat.brim_mm
    return float(np.cov(clean.ravel(), now.ravel())[0, 1] / np.var(clean, ddof=1))


@pytest.mark.parametrize("height_mm", [2.0, 5.0, 12.0])
def test_pits_are_log_normal_and_of_the_size_of_pits_on_steel(height_mm: float) -> None:
    drawn = [draw_pits(bare_part(height_mm=height_mm), np.random.default_rng(seed)) for seed in range(40)]
    depth = np.concatenate([p.height_mm for p in drawn])
    width = 2.0 * np.concatenate([p.radius_mm for p in drawn])
    log = np.log(depth)
    # a log-normal's mean stands above its median by exp(sigma^2 / 2); drawn by the thousand, within 5 %
    assert depth.size > 1000
    assert depth.mean() / np.median(depth) == pytest.approx(np.exp(0.5 * log.var()), rel=0.05)
    assert abs(((log - log.mean()) ** 3).mean() / log.std() ** 3) < 0.2
    # wider than deep, a tenth to a few mm across, less than 2.5 mm deep: as ASTM G46's charts grade them
    assert (depth < width).all()
    assert 0.05 < np.median(width) < 3.0
    assert depth.max() < 2.5


@pytest.mark.parametrize("raised", [False, True])
def test_marks_fade_on_the_way(raised: bool) -> None:
    contrast = [
        np.mean([_contrast(_rusted(a, seed, raised)) for seed in SEEDS]) for a in (0.05, 0.3, 0.6, 1.0)
    ]
    assert contrast[0] > 0.85
    assert contrast == sorted(contrast, reverse=True)
    assert contrast[-1] < 0.4


def test_rust_stands_in_marks_and_in_places_above_the_land_that_was() -> None:
    coat = bare_part()
    deep = mark_depth_mm(coat)
    mark = coat.brim_mm - coat.clean_mm > 0.7 * deep
    rise = np.concatenate([(_rusted(1.0, seed).z_mm - coat.clean_mm)[mark] for seed in SEEDS])
    over = np.concatenate([(_rusted(1.0, seed).z_mm - coat.brim_mm)[mark] for seed in SEEDS])
    assert np.median(rise) > 0.5 * deep
    assert 0.05 < (over > 0.0).mean() < 0.95


def test_land_is_lost_where_scale_has_flaked_and_swells_where_it_has_not() -> None:
    coat = bare_part()
    deep = mark_depth_mm(coat)
    land = np.abs(coat.brim_mm - coat.clean_mm) < 0.1 * deep
    change = np.concatenate([(_rusted(0.8, seed).z_mm - coat.clean_mm)[land] for seed in SEEDS])
    low, high = np.quantile(change, [0.05, 0.95])
    assert low < -0.1 * deep
    assert high > 0.3 * deep
    # nowhere more than all laminas, a blister and half a millimetre of it together would make
    assert change.max() < 0.45 * 0.4 * coat.height_mm + 4.0 * deep


def test_only_the_top_of_the_rust_yields() -> None:
    coat, rusty = bare_part(), _rusted(0.8)
    deep = mark_depth_mm(coat)
    soft = rusty.soft_mm > 0.0
    assert soft.mean() > 0.5
    assert (rusty.hardness_mpa[soft] < 100.0).all()
    assert (rusty.hardness_mpa[~soft] == coat.hardness_mpa[~soft]).all()
    # compact rust below stands as high as it did: most of what was laid on does not give way
    assert np.quantile(rusty.soft_mm, 0.9) < 0.35 * deep
    assert rusty.friction[soft].mean() > 0.4


def test_it_begins_in_nests() -> None:
    """A little of it leaves most steel without scale, and the marks rust no later than the land."""
    coat = bare_part()
    cover = np.mean([(_rusted(0.15, seed).soft_mm > 0.0).mean() for seed in SEEDS])
    assert 0.02 < cover < 0.6
    mark = coat.brim_mm - coat.clean_mm > 0.5 * mark_depth_mm(coat)
    sooner = [(_rusted(0.15, s).soft_mm > 0.0)[mark].mean() - cover for s in SEEDS]
    assert np.mean(sooner) > 0.0
