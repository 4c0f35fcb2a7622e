"""Soils that are laid on: caked grime, mud, paint, and what welding leaves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.soiling.caked import LEAST_MPA, OLD_MPA, YOUNG_MPA, caked
from glyphs.soiling.coat import Coat
from glyphs.soiling.mud import sheets as model
from glyphs.soiling.mud.grid import Grid, thin_grid
from glyphs.soiling.mud.sheets import HARDNESS_MPA, mud
from glyphs.soiling.paint.coats import level_film, paint
from glyphs.soiling.weld.grinder import FURROW_MM, crown, grind
from glyphs.soiling.weld.molten import Seam, add_arc_strikes, add_spatter
from glyphs.soiling.weld.plate import weld
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

# ------------------------------------------------------------------------------------------------------------- caked

SEEDS = range(6)
_caked_coat = partial(bare_part, "B4T8", rows=50, seed=3)


@cache
def _caked(amount: float, seed: int, height_mm: float = 5.0, raised: bool = False) -> Coat:
    return caked(_caked_coat(height_mm=height_mm, raised=raised), amount, rng=np.random.default_rng(seed))


def _cake_mm(amount: float, seed: int) -> Field:
    return np.asarray(_caked(amount, seed).z_mm - _caked_coat(height_mm=5.0).z_mm)


def _floor(coat: Coat) -> NDArray[np.bool_]:
    """Where a groove is deeper than two thirds of the deepest."""
    hollow = coat.hollow_mm()
    return np.asarray(hollow > 0.67 * hollow.max(), dtype=np.bool_)


def _land(coat: Coat) -> NDArray[np.bool_]:
    return np.asarray(np.abs(coat.clean_mm - coat.brim_mm) < 0.02, dtype=np.bool_)


def test_it_only_adds() -> None:
    for amount in (0.1, 0.4, 1.0):
        assert _cake_mm(amount, 0).min() >= 0.0


def test_grooves_catch_before_the_land_and_end_full() -> None:
    coat = _caked_coat()
    floor, land = _floor(coat), _land(coat)
    early = np.mean([_cake_mm(0.4, s)[floor].mean() / _cake_mm(0.4, s)[land].mean() for s in SEEDS])
    assert early > 1.5
    left = np.mean([_caked(1.0, s).hollow_mm()[floor].mean() for s in SEEDS])
    assert left < 0.15 * coat.hollow_mm()[floor].mean()


@pytest.mark.parametrize("raised", [False, True])
def test_the_marks_are_lost_in_the_heights(raised: bool) -> None:
    """What the clean relief explains of the heights: most of them at a quarter, next to nothing at the whole."""
    coat = _caked_coat(raised=raised)
    clean = (coat.clean_mm - coat.brim_mm).ravel()

    def explained(amount: float) -> float:
        tops = [(_caked(amount, s, raised=raised).z_mm - coat.brim_mm).ravel() for s in SEEDS]
        return float(np.mean([np.corrcoef(clean, top)[0, 1] for top in tops]))

    assert explained(0.25) > 0.75
    assert explained(1.0) < 0.35


def test_it_yields_by_age() -> None:
    """Where the cake is thick, hardness spans the young and the old."""
    # at 0.06 mm, five times the hiding thickness, 0.7 % of the logarithm of the metal's hardness is left
    hardness = np.concatenate([_caked(0.7, s).hardness_mpa[_cake_mm(0.7, s) > 0.06] for s in SEEDS])
    assert hardness.min() >= LEAST_MPA
    assert hardness.max() < 1.1 * OLD_MPA
    low, high = np.quantile(hardness, (0.02, 0.98))
    assert low < 4 * YOUNG_MPA
    assert high > 0.4 * OLD_MPA


def test_narrow_grooves_are_roofed_before_wide_ones_and_roofs_yield() -> None:
    """Two grooves of one depth, 0.1 and 0.5 heights wide: as much lodges in either, and rims meet over one only."""
    coat = _caked_coat()
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
    np.testing.assert_allclose(soiled.soft_mm, _cake_mm(0.6, 2), atol=1e-6)


# --------------------------------------------------------------------------------------------------------------- mud

BATCH = model.Batch(share=1.0, moisture=0.2, solid=0.6, flight_rad=0.0, rain=0.8)


@cache
def _plate(pitch_mm: float = 0.05) -> Coat:
    """A flat plate of 20 mm x 20 mm without a mark."""
    coat = bare_part()
    side = int(20 / pitch_mm)
    flat, full = np.zeros((side, side), np.float32), np.ones((side, side), np.float32)
    return replace(
        coat,
        pitch_mm=pitch_mm,
        clean_mm=flat,
        brim_mm=flat,
        z_mm=flat,
        soft_mm=flat,
        hardness_mpa=2000 * full,
        friction=0.2 * full,
        albedo=0.2 * np.ones((side, side, 3), np.float32),
        roughness=0.3 * full,
        reflectance=0.5 * full,
    )


def test_the_groove_shows_through_as_a_shallower_dip() -> None:
    """An even, thick film shrinks to 0.6 of its depth everywhere: 0.4 to 0.6 of the groove is left."""
    coat = bare_part()
    grid = thin_grid(coat)
    thick = model._dry_thickness(model._wet_level(coat, grid), np.full(coat.shape, 0.4, np.float32), 0.6)
    groove = coat.brim_mm - coat.z_mm > 0.8 * grid.depth_mm
    land = np.abs(coat.brim_mm - coat.z_mm) < 0.02
    top = coat.z_mm + thick
    before = coat.z_mm[land].mean() - coat.z_mm[groove].mean()
    left = (top[land].mean() - top[groove].mean()) / before
    assert 0.35 < left < 0.75
    assert thick[groove].mean() > 1.2 * thick[land].mean()


def test_a_dried_drop_is_higher_at_its_rim() -> None:
    """Coffee rings: along an isolated drop's radius the highest place is nearer to the rim than to the middle."""
    grid = Grid(1, (400, 400), 0.05, 5.0, 0.2)
    wet = model._splashes(grid, 0.3, BATCH, np.random.default_rng(3))
    inside = wet > 0
    from scipy.ndimage import distance_transform_edt, label

    drops, count = label(inside)
    away = distance_transform_edt(inside)
    ratios = []
    for k in range(1, count + 1):
        here = drops == k
        widest = away[here].max()
        if widest > 8:
            middle = wet[here & (away > 0.8 * widest)].mean()
            rim = wet[here & (away > 0.1 * widest) & (away < 0.35 * widest)].mean()
            ratios.append(rim / middle)
    assert len(ratios) >= 5
    assert np.median(ratios) > 1.2


def _width_of_plates_mm(thick_mm: float) -> float:
    """Of the plates of an even layer: two over the cracks' length in an area, as for a square net."""
    from scipy.ndimage import gaussian_filter
    from skimage.morphology import skeletonize

    coat = _plate()
    even = np.full(coat.shape, thick_mm, np.float32)
    gap, _ = model._cracks(coat, thin_grid(coat), even, np.random.default_rng(2))
    cracks = skeletonize(gaussian_filter(gap, 1.0) > 0.2)
    return float(2.0 * coat.area_mm2 / (1.1 * cracks.sum() * coat.pitch_mm))


def test_thicker_mud_cracks_wider_apart() -> None:
    """Distance of cracks grows with thickness, 3 to 10 times it."""
    widths = {t: _width_of_plates_mm(t) for t in (0.2, 0.4, 0.8)}
    assert widths[0.2] < widths[0.4] < widths[0.8]
    for thick, width in widths.items():
        assert 3.0 < width / thick < 10.0, widths


def test_a_thin_film_does_not_crack() -> None:
    coat = _plate()
    film = np.full(coat.shape, 0.01, np.float32)
    gap, _ = model._cracks(coat, thin_grid(coat), film, np.random.default_rng(2))
    assert gap.max() == 0.0


def test_plates_curl_up_at_their_edges() -> None:
    coat = _plate()
    even = np.full(coat.shape, 0.4, np.float32)
    gap, lift = model._cracks(coat, thin_grid(coat), even, np.random.default_rng(2))
    from scipy.ndimage import distance_transform_edt

    away_mm = distance_transform_edt(gap == 0.0) * coat.pitch_mm
    assert lift[(gap == 0.0) & (away_mm < 0.1)].mean() > 0.4
    assert lift[away_mm > 0.8].mean() < 0.1


def test_sand_does_not_yield_and_mud_does() -> None:
    """Moist to bone dry mud yields at 1 to 20 MPa; grains of up to half a millimetre stay hard in it."""
    seen = []
    for seed in range(12):
        coat = mud(bare_part(), 1.0, rng=np.random.default_rng(seed))
        yields = coat.soft_mm > 0.0
        stones = ~yields & (coat.z_mm - coat.clean_mm > 0.02)
        seen.append(float(np.median(coat.hardness_mpa[yields])))
        assert (coat.hardness_mpa[yields] <= HARDNESS_MPA[1] + 1e-3).all()
        assert (coat.hardness_mpa[yields] >= HARDNESS_MPA[0] - 1e-3).all()
        assert stones.any()
        assert (coat.hardness_mpa[stones] >= 1000.0).all()
    assert max(seen) > 2.0 * min(seen)


def test_rain_takes_the_lands_mud_first() -> None:
    coat = bare_part()
    grid = thin_grid(coat)
    left = model._rain_share(coat, grid, 0.3, BATCH, np.random.default_rng(0))
    sheltered = coat.brim_mm - coat.z_mm > 0.9 * grid.depth_mm
    assert left[sheltered].mean() > 0.9
    assert left[~sheltered].mean() < 0.85


# ------------------------------------------------------------------------------------------------------------- paint

PITCH_MM = 0.05
SECONDS_PER_PA_S = 20.0


_clean = partial(bare_part, "B4H")


@cache
def _painted(amount: float, seed: int) -> Coat:
    return paint(_clean(), amount, rng=np.random.default_rng(seed))


def _ripple(length_mm: float) -> Field:
    """Of 10 um, on a coat of 0.1 mm; a whole number of half waves on 6 mm."""
    x = (np.arange(120, dtype=np.float32) + 0.5) * PITCH_MM
    return np.tile(0.1 + 0.01 * np.cos(2 * np.pi * x / length_mm), (40, 1)).astype(np.float32)


@pytest.mark.parametrize("length_mm", [12.0, 6.0, 4.0, 3.0])
def test_a_ripple_fades_as_orchard_says(length_mm: float) -> None:
    flat = np.zeros((40, 120), dtype=np.float32)
    film = level_film(flat, _ripple(length_mm), pitch_mm=PITCH_MM, seconds_per_pa_s=SECONDS_PER_PA_S)
    # surface tension 0.03 N/m, film 1e-4 m; wave number in 1/m
    k = 2 * np.pi / (1e-3 * length_mm)
    expected = np.exp(-SECONDS_PER_PA_S * k**4 * 0.03 * 1e-12 / 3)
    # float32 of a 0.1 mm film is good to 1e-8 mm of a ripple of 1e-2
    assert np.ptp(film) / np.ptp(_ripple(length_mm)) == pytest.approx(expected, abs=1e-4)


def test_no_paint_is_lost_and_it_pools_in_grooves() -> None:
    ground = np.zeros((40, 120), dtype=np.float32)
    ground[:, 55:65] = -0.2
    wet = np.full(ground.shape, 0.1, dtype=np.float32)
    film = level_film(ground, wet, pitch_mm=PITCH_MM, seconds_per_pa_s=SECONDS_PER_PA_S)
    assert film.mean() == pytest.approx(0.1, rel=1e-4)
    assert film[:, 58:62].min() > 0.15
    # an edge keeps less than open land, and never nothing
    assert film[:, 53:55].max() < 0.8 * film[:, :20].mean()
    assert film.min() >= 0.3 * 0.1 - 1e-6


def test_enamel_is_hard_and_chassis_paint_yields() -> None:
    coats = [_painted(0.8, seed) for seed in range(12)]
    hard = [c for c in coats if c.soft_mm.max() == 0.0]
    rubbery = [c for c in coats if c.soft_mm.mean() > 0.5 * (c.z_mm - _clean().z_mm).mean()]
    assert len(hard) >= 3
    assert rubbery
    assert all(np.median(c.hardness_mpa) < 30.0 for c in rubbery)
    assert min(np.median(c.hardness_mpa) for c in hard) > 100.0
    assert min(np.median(c.friction) for c in rubbery) > max(np.median(c.friction) for c in hard)


def test_flakes_lay_bare_metal_with_sharp_edges() -> None:
    """Where enamel is off down to the steel, the surface is the clean one, and full film begins two samples away."""
    found = 0
    for seed in range(8):
        film = _painted(1.0, seed).z_mm - _clean().z_mm
        bare = film < 1e-6
        rise = np.abs(np.diff(film, axis=1))
        step = bare[:, :-1] & ~bare[:, 1:] & (film[:, 1:] > 0.02)
        found += int(step.sum())
        if step.any():
            assert rise[step].max() > 4 * np.median(rise)
    assert found > 20


# -------------------------------------------------------------------------------------------------------------- weld

_welded_coat = partial(bare_part, rows=50)


def _seam(coat: Coat) -> Seam:
    return Seam(np.array([1.0, 0.0]), 0.0, 0.3 * coat.shape[1] * coat.pitch_mm)


def test_nothing_of_it_yields_and_what_was_soft_is_burnt() -> None:
    coat = _welded_coat()
    assert weld(coat, 0.8, rng=np.random.default_rng(0)).soft_mm.max() == 0.0
    greasy = replace(coat, soft_mm=coat.soft_mm + np.float32(0.05))
    left = weld(greasy, 0.8, rng=np.random.default_rng(0)).soft_mm
    assert left.max() <= 0.05 + 1e-6
    assert left.mean() < 0.025


def test_drops_only_add_and_fall_off_with_distance_from_the_seam() -> None:
    coat = _welded_coat()
    seam = _seam(coat)
    shares = []
    for seed in range(8):
        z, cover = add_spatter(coat, coat.z_mm, seam, 0.7, 0.4, np.random.default_rng(seed))
        assert (z >= coat.z_mm).all()
        # the largest drop is 3 mm wide, and none stands higher than half its width
        assert (z - coat.z_mm).max() < 1.5 + np.ptp(coat.z_mm)
        third = cover.shape[1] // 3
        shares.append((cover[:, :third].mean(), cover[:, -third:].mean()))
    near, far = np.mean(shares, axis=0)
    # two thirds of the plate are 2.2 reaches: e to the power of it is 9, chance and overlaps leave half of that
    assert near > 3.0 * far


def test_a_disc_takes_tops_and_leaves_floors() -> None:
    coat = _welded_coat()
    level = crown(coat)
    depth = float(np.quantile(level - coat.clean_mm, 0.97))
    z, bright = grind(coat, coat.z_mm, level, 0.3, np.random.default_rng(2))
    floor = level - coat.clean_mm > 0.9 * depth
    land = level - coat.clean_mm < 0.1 * depth
    assert (coat.z_mm - z)[land].mean() > 5 * abs((coat.z_mm - z)[floor].mean())
    assert bright[land].mean() > bright[floor].mean()
    # a burr is at most a third of the deepest furrow high; the lip over an edge stays below the disc
    assert (z - coat.z_mm)[land].max() < 0.35 * FURROW_MM[1] + 0.1 * depth


def test_an_arc_strike_is_a_crater_with_a_rim() -> None:
    coat = _welded_coat()
    flat = np.zeros_like(coat.z_mm)
    for seed in range(4):
        z, cover = add_arc_strikes(coat, flat, 1.0, np.random.default_rng(seed))
        assert z[cover == 0].max(initial=0.0) < 0.01
        if (cover > 0.9).any():
            assert z.min() < -0.03
            assert z.max() > 0.01
