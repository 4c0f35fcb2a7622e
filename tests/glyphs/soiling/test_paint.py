"""Paint: it levels, runs into grooves, sinks when it dries, goes downhill, flakes off, and yields if it is rubbery."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from glyphs.soiling.coat import Coat
from glyphs.soiling.paint.coats import WET_MM, level_film, paint
from glyphs.surface.noise import Field
from tests.support.coats import bare_part

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


def test_a_coat_on_open_land_is_as_thick_as_coats_are() -> None:
    land = _clean().hollow_mm() == 0.0
    thickness = [np.median((_painted(1.0, seed).z_mm - _clean().z_mm)[land]) for seed in range(8)]
    # three coats; what dries keeps 0.42 to 0.77 of its volume, and much of it lies in the grooves
    assert min(thickness) > 3 * WET_MM[0] * 0.42 * 0.5
    assert max(thickness) < 3 * WET_MM[1] * 0.77
    assert np.mean(thickness) == pytest.approx(0.25, abs=0.15)


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
