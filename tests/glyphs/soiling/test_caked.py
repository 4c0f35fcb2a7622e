"""Caked grime: what it fills, what it leaves, what yields."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.soiling.caked import DRY_FRICTION, LEAST_MPA, OILY_FRICTION, OLD_MPA, YOUNG_MPA, caked
from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

SEEDS = range(6)
_coat = partial(bare_part, "B4T8", rows=50, seed=3)


@cache
def _caked(amount: float, seed: int, height_mm: float = 5.0, raised: bool = False) -> Coat:
    return caked(_coat(height_mm=height_mm, raised=raised), amount, rng=np.random.default_rng(seed))


def _laid(amount: float, seed: int) -> Field:
    return np.asarray(_caked(amount, seed).z_mm - _coat(height_mm=5.0).z_mm)


def _floor(coat: Coat) -> NDArray[np.bool_]:
    """Where a groove is deeper than two thirds of the deepest."""
    hollow = coat.hollow_mm()
    return np.asarray(hollow > 0.67 * hollow.max(), dtype=np.bool_)


def _land(coat: Coat) -> NDArray[np.bool_]:
    return np.asarray(np.abs(coat.clean_mm - coat.brim_mm) < 0.02, dtype=np.bool_)


def test_it_only_adds() -> None:
    for amount in (0.1, 0.4, 1.0):
        assert _laid(amount, 0).min() >= 0.0


def test_grooves_catch_before_the_land_and_end_full() -> None:
    coat = _coat()
    floor, land = _floor(coat), _land(coat)
    early = np.mean([_laid(0.4, s)[floor].mean() / _laid(0.4, s)[land].mean() for s in SEEDS])
    assert early > 1.5
    left = np.mean([_caked(1.0, s).hollow_mm()[floor].mean() for s in SEEDS])
    assert left < 0.15 * coat.hollow_mm()[floor].mean()


@pytest.mark.parametrize("raised", [False, True])
def test_the_marks_are_lost_in_the_heights(raised: bool) -> None:
    """What the clean relief explains of the heights: most of them at a quarter, next to nothing at the whole."""
    coat = _coat(raised=raised)
    clean = (coat.clean_mm - coat.brim_mm).ravel()

    def explained(amount: float) -> float:
        tops = [(_caked(amount, s, raised=raised).z_mm - coat.brim_mm).ravel() for s in SEEDS]
        return float(np.mean([np.corrcoef(clean, top)[0, 1] for top in tops]))

    assert explained(0.25) > 0.75
    assert explained(1.0) < 0.35


def test_it_yields_by_age() -> None:
    """Where the cake is thick, hardness spans the young and the old."""
    # at 0.06 mm, five times the hiding thickness, 0.7 % of the logarithm of the metal's hardness is left
    hardness = np.concatenate([_caked(0.7, s).hardness_mpa[_laid(0.7, s) > 0.06] for s in SEEDS])
    assert hardness.min() >= LEAST_MPA
    assert hardness.max() < 1.1 * OLD_MPA
    low, high = np.quantile(hardness, (0.02, 0.98))
    assert low < 4 * YOUNG_MPA
    assert high > 0.4 * OLD_MPA


def test_narrow_grooves_are_roofed_before_wide_ones_and_roofs_yield() -> None:
    """Two grooves of one depth, 0.1 and 0.5 heights wide: as much lodges in either, and rims meet over one only."""
    coat = _coat()
    column = np.arange(coat.shape[1])
    narrow, wide = (np.abs(column - at) <= half for at, half in ((40, 2), (120, 12)))
    groove = np.where(narrow | wide, -0.2, 0.0).astype(np.float32)
    flat = np.broadcast_to(groove, coat.shape).copy()
    plate = replace(coat, clean_mm=flat, z_mm=flat, brim_mm=np.zeros_like(flat))
    soiled = [caked(plate, 0.5, rng=np.random.default_rng(s)) for s in range(24)]
    tops = np.mean([s.z_mm.mean(axis=0) for s in soiled], axis=0)
    weak = np.mean([(s.hardness_mpa < YOUNG_MPA).mean(axis=0) for s in soiled], axis=0)
    assert tops[narrow].mean() > tops[wide].mean() + 0.01
    assert weak[narrow].mean() > 2.0 * weak[wide].mean()


def test_all_of_it_may_yield_and_nothing_under_it() -> None:
    soiled = _caked(0.6, 2)
    np.testing.assert_allclose(soiled.soft_mm, _laid(0.6, 2), atol=1e-6)


def test_oily_slides_dry_drags() -> None:
    friction = np.concatenate([_caked(1.0, s).friction.ravel() for s in SEEDS])
    assert friction.min() >= OILY_FRICTION - 1e-3
    assert friction.max() <= DRY_FRICTION + 1e-3
    assert np.quantile(friction, 0.9) - np.quantile(friction, 0.1) > 0.2
