"""What welding leaves beside it: hard all through, fills and takes where the physics says so."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.weld.grinder import FURROW_MM, crown, grind
from glyphs.soiling.weld.molten import Seam, add_arc_strikes, add_spatter
from glyphs.soiling.weld.plate import SCALE_MM, _add_scale, weld
from tests.support.coats import bare_part

_coat = partial(bare_part, rows=50)


def _seam(coat: Coat) -> Seam:
    return Seam(np.array([1.0, 0.0]), 0.0, 0.3 * coat.shape[1] * coat.pitch_mm)


def test_nothing_of_it_yields_and_what_was_soft_is_burnt() -> None:
    coat = _coat()
    assert weld(coat, 0.8, rng=np.random.default_rng(0)).soft_mm.max() == 0.0
    greasy = replace(coat, soft_mm=coat.soft_mm + np.float32(0.05))
    left = weld(greasy, 0.8, rng=np.random.default_rng(0)).soft_mm
    assert left.max() <= 0.05 + 1e-6
    assert left.mean() < 0.025


def test_drops_only_add_and_fall_off_with_distance_from_the_seam() -> None:
    coat = _coat()
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
    coat = _coat()
    level = crown(coat)
    depth = float(np.quantile(level - coat.clean_mm, 0.97))
    z, bright = grind(coat, coat.z_mm, level, 0.3, np.random.default_rng(2))
    floor = level - coat.clean_mm > 0.9 * depth
    land = level - coat.clean_mm < 0.1 * depth
    assert (coat.z_mm - z)[land].mean() > 5 * abs((coat.z_mm - z)[floor].mean())
    assert bright[land].mean() > bright[floor].mean()
    # a burr is at most a third of the deepest furrow high; the lip over an edge stays below the disc
    assert (z - coat.z_mm)[land].max() < 0.35 * FURROW_MM[1] + 0.1 * depth


def test_scale_is_thin_dark_and_in_plates() -> None:
    coat = _coat()
    for seed in range(4):
        z, cover = _add_scale(coat, 1.0, np.random.default_rng(seed))
        rise = (z - coat.z_mm)[cover > 0.99]
        assert rise.min() >= SCALE_MM[0] - 1e-5
        # lifted ends stand up to 8 * 0.3 of the thickness higher
        assert rise.max() <= 3.4 * SCALE_MM[1] + 1e-5
        # three in ten of the plates never held, and cracks take their share
        assert 0.3 < cover.mean() < 0.8


def test_an_arc_strike_is_a_crater_with_a_rim() -> None:
    coat = _coat()
    flat = np.zeros_like(coat.z_mm)
    for seed in range(4):
        z, cover = add_arc_strikes(coat, flat, 1.0, np.random.default_rng(seed))
        assert z[cover == 0].max(initial=0.0) < 0.01
        if (cover > 0.9).any():
            assert z.min() < -0.03
            assert z.max() > 0.01
