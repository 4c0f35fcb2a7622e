"""Soils that take metal: castings, rust and wear."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, find_objects, gaussian_filter, label

from glyphs.soiling.casting.pour import casting
from glyphs.soiling.casting.sand import SAND_HARDNESS_MPA
from glyphs.soiling.coat import STEEL_HARDNESS_MPA, Coat
from glyphs.soiling.rust.corrosion import draw_pits, mark_depth_mm, rust
from glyphs.soiling.wear import rubbing as wear
from glyphs.soiling.wear.bench import on_bench
from glyphs.soiling.wear.blows import knock, peen
from glyphs.soiling.wear.rubbing import wear as worn
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

# ----------------------------------------------------------------------------------------------------------- casting

_clean = partial(bare_part, "KX40", rows=100, seed=2)


@cache
def _cast(amount: float, seed: int = 0, height_mm: float = 5.0, raised: bool = False) -> Coat:
    return casting(_clean(height_mm=height_mm, raised=raised), amount, rng=np.random.default_rng(seed))


def _fine_mm(coat: Coat) -> Field:
    """What is finer than two grains, away from the edges of the mark."""
    rest = coat.z_mm - gaussian_filter(coat.z_mm, 0.1 * coat.height_mm / coat.pitch_mm)
    land = np.abs(coat.clean_mm - coat.brim_mm) < 0.01 * coat.height_mm
    return np.asarray(rest[land], dtype=np.float32)


@pytest.mark.parametrize("height_mm", [2.0, 5.0, 12.0])
def test_roughness_is_that_of_sand_castings(height_mm: float) -> None:
    """Ra of the land between its defects (median over parts, defects clipped): 3 to 50 um, coarser for large ones."""
    ra_um = []
    for seed in range(3):
        fine = _fine_mm(_cast(0.4, seed, height_mm))
        low, high = np.percentile(fine, (2, 90))
        kept = fine[(fine > low) & (fine < high)]
        ra_um.append(1000.0 * np.abs(kept - kept.mean()).mean())
    assert 3.0 <= np.median(ra_um) <= 50.0


def test_only_loose_sand_yields_and_it_lies_in_hollows() -> None:
    clean = _clean()
    soft = [_cast(0.5, seed).soft_mm for seed in range(4)]
    hollow = clean.hollow_mm() > 0.1
    inside, outside = (np.mean([s[where].mean() for s in soft]) for where in (hollow, ~hollow))
    assert inside > 1.5 * outside
    for seed in range(4):
        coat = _cast(0.5, seed)
        yields = coat.soft_mm > 0.0
        np.testing.assert_allclose(coat.hardness_mpa[yields], SAND_HARDNESS_MPA)
        np.testing.assert_allclose(coat.hardness_mpa[~yields], STEEL_HARDNESS_MPA)
        # sand fills what is hollow and never heaps over the brim
        assert (coat.z_mm <= coat.brim_mm + 1e-4)[yields].all()


@pytest.mark.parametrize("raised", [False, True])
def test_misrun_and_burn_on_take_the_relief(raised: bool) -> None:
    """Strokes end up hardly lower, or higher, than what lies beside them."""
    clean = _clean(raised=raised)
    away = np.abs(clean.clean_mm - np.median(clean.clean_mm))
    mark = away > 0.6 * away.max()
    beside = binary_dilation(mark, iterations=25) & ~binary_dilation(mark, iterations=12)

    def contrast_mm(coat: Coat) -> float:
        return abs(float(np.median(coat.z_mm[mark]) - np.median(coat.z_mm[beside])))

    whole = contrast_mm(clean)
    shares = [
        np.mean([contrast_mm(_cast(amount, seed, raised=raised)) for seed in range(3)]) / whole
        for amount in (0.1, 0.5, 1.0)
    ]
    assert shares[0] > 0.85
    assert shares[0] > shares[1] > shares[2]
    assert shares[2] < 0.5


def test_holes_are_round_and_open_wider() -> None:
    clean = _clean()
    # more than a stroke's depth under the deepest of the mark: nothing but gas digs there
    deep = clean.clean_mm.min() - 0.12
    open_share = [
        np.mean([(_cast(a, seed).z_mm < deep).mean() for seed in range(4)]) for a in (0.3, 0.6, 1.0)
    ]
    assert 0.0 <= open_share[0] < open_share[1] < open_share[2]
    slimness = []
    for seed in range(4):
        spots, _ = label(_cast(1.0, seed).z_mm < deep)
        for rows, cols in find_objects(spots):
            tall, wide = rows.stop - rows.start, cols.stop - cols.start
            if min(tall, wide) >= 5 and rows.start > 0 and rows.stop < clean.shape[0]:
                slimness.append(max(tall / wide, wide / tall))
    assert len(slimness) >= 3
    assert np.median(slimness) < 1.3


# -------------------------------------------------------------------------------------------------------------- rust

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


# -------------------------------------------------------------------------------------------------------------- wear

_worn_coat = partial(bare_part, "H8", seed=1, varied=False)


def _rubbed(coat: Coat, amount: float, *, soft: float) -> Field:
    life = wear._Life(rubbed=1.0, peened=0.0, knocked=0.0, soft=soft, crossed=0.0)
    z, _ = wear._rub(on_bench(coat), coat.z_mm, amount, life, rng=np.random.default_rng(0))
    return z


@pytest.mark.parametrize("soft", [0.0, 1.0])
def test_rubbing_lowers_the_land_and_leaves_the_floor(soft: float) -> None:
    coat = _worn_coat()
    taken = coat.z_mm - _rubbed(coat, 0.4, soft=soft)
    deep = on_bench(coat).deep_mm
    floor = coat.z_mm < -0.95 * deep
    land = coat.z_mm > -0.05 * deep
    assert taken[floor].max() < 0.02 * deep
    # 0.4 of 0.72 to 1.17 depths
    assert 0.25 * deep < np.median(taken[land]) < 0.5 * deep
    assert taken.min() >= -1e-6


def test_raised_marks_go_before_their_land() -> None:
    coat = _worn_coat(raised=True)
    taken = coat.z_mm - _rubbed(coat, 0.4, soft=0.0)
    deep = on_bench(coat).deep_mm
    assert np.median(taken[coat.z_mm > 0.9 * deep]) > 0.2 * deep
    assert np.median(taken[coat.z_mm < 0.1 * deep]) < 0.02 * deep


def test_a_file_scores_and_a_buff_does_not() -> None:
    coat = _worn_coat()
    deep = on_bench(coat).deep_mm
    rows = slice(0, coat.shape[0] // 8)  # land over the characters
    file, buff = (np.diff(_rubbed(coat, 0.5, soft=soft)[rows], axis=0).std() for soft in (0.0, 1.0))
    assert file > 3.0 * buff
    scored = _rubbed(coat, 0.5, soft=0.0)[rows]
    # a score is at most 0.7 of a depth
    assert 0.05 * deep < np.ptp(scored) < deep


def test_peening_moves_metal_and_takes_none() -> None:
    coat = _worn_coat()
    z, hit = peen(on_bench(coat), coat.z_mm, 0.8, rng=np.random.default_rng(2))
    moved = z - coat.z_mm
    # what crosses the border of the plate is lost to the sum: a tenth of what moved is room for it
    assert abs(moved.sum()) < 0.1 * np.abs(moved).sum()
    deep = on_bench(coat).deep_mm
    groove = coat.z_mm < -0.5 * deep
    assert moved[groove].mean() > 0.1 * deep
    assert moved[~groove].mean() < 0.0
    assert 0.0 <= hit.min() <= hit.max() <= 1.0


def test_knocks_pile_metal_up_beside_them() -> None:
    coat = _worn_coat()
    z, _ = knock(on_bench(coat), coat.z_mm, 0.7, rng=np.random.default_rng(4))
    up, down = np.maximum(z - coat.z_mm, 0.0).sum(), np.maximum(coat.z_mm - z, 0.0).sum()
    assert 0.15 * down < up < down


def test_worn_metal_is_as_hard_as_the_part_and_bright() -> None:
    clean, used = _worn_coat(), worn(_worn_coat(), 0.8, rng=np.random.default_rng(5))
    assert not used.soft_mm.any()
    np.testing.assert_array_equal(used.hardness_mpa, clean.hardness_mpa)
    fresh = clean.z_mm - used.z_mm > 0.3 * on_bench(clean).deep_mm
    assert fresh.mean() > 0.1
    assert used.albedo[fresh].mean() > clean.albedo[fresh].mean()
    assert used.reflectance[fresh].mean() > clean.reflectance[fresh].mean()
