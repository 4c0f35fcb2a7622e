"""Castings: what cold metal, sand and gas each do to a mark."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, find_objects, gaussian_filter, label

from glyphs.soiling.casting.pour import casting
from glyphs.soiling.casting.sand import SAND_HARDNESS_MPA
from glyphs.soiling.coat import STEEL_HARDNESS_MPA, Coat
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

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
