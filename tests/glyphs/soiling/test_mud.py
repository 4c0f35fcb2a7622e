"""Mud: films that show the groove through, drops with rings, cracks by thickness, sand that does not yield."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.mud import sheets as model
from glyphs.soiling.mud.grid import Grid, thin_grid
from glyphs.soiling.mud.sheets import HARDNESS_MPA, mud
from tests.support.coats import bare_part

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
