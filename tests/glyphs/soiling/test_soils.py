"""What every soil keeps to, whatever it is made of; the mixed dirt of a workshop."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs import stamp
from glyphs.soiling.coat import Coat
from glyphs.soiling.soiled import SoiledPart, Soiling, soil_part
from glyphs.soiling.soils import SOILS, soil_model
from glyphs.soiling.workshop.debris import HIGHEST_MM
from glyphs.soiling.workshop.films import OIL_FRICTION, PAINT_MPA
from glyphs.soiling.workshop.grime import HARDEST_MPA, SOFTEST_MPA
from glyphs.soiling.workshop.mixture import Dirt
from glyphs.stamping.errors import StampError
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap, MapError
from glyphs.surface.noise import share, smooth_noise
from tests.support.coats import bare_part

# ------------------------------------------------------------------------------------------------------------- soils

ARRAYS = tuple(f.name for f in fields(Coat) if f.name not in ("pitch_mm", "height_mm"))
every_soil = pytest.mark.parametrize("soil", SOILS)


_coat = partial(bare_part, rows=40)


def _laid(soil: str, amount: float, seed: int = 0, raised: bool = False, height_mm: float = 5.0) -> Coat:
    return soil_model(soil)(
        _coat(raised=raised, height_mm=height_mm), amount, rng=np.random.default_rng(seed)
    )


_soiled = cache(_laid)


@every_soil
def test_nothing_of_it_changes_nothing(soil: str) -> None:
    clean, none = _coat(), _soiled(soil, 0.0)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(none, name), getattr(clean, name), err_msg=name)


@every_soil
@pytest.mark.parametrize(
    ("amount", "raised", "height_mm"),
    [(0.1, False, 5.0), (1.0, False, 5.0), (0.5, True, 5.0), (1.0, False, 2.0), (0.5, False, 12.0)],
)
def test_what_comes_out_is_a_surface(soil: str, amount: float, raised: bool, height_mm: float) -> None:
    clean, soiled = _coat(raised=raised, height_mm=height_mm), _soiled(soil, amount, 1, raised, height_mm)
    for name in ARRAYS:
        values = getattr(soiled, name)
        assert values.shape == getattr(clean, name).shape, name
        assert values.dtype == np.float32, name
        assert np.isfinite(values).all(), name
    assert soiled.soft_mm.min() >= 0.0
    assert soiled.hardness_mpa.min() > 0.0
    assert soiled.friction.min() >= 0.0
    assert soiled.friction.max() <= 1.5
    for name, least in (("albedo", 0.0), ("roughness", 1e-3), ("reflectance", 0.0)):
        assert least <= getattr(soiled, name).min(), name
        assert getattr(soiled, name).max() <= 1.0, name
    # what yields was laid on, so it is no thicker than what stands over the deepest the part was ever cut to; pits and
    # dishes are up to half a millimetre deep, and in large castings up to a tenth of a character's height
    deepest_mm = clean.z_mm.min() - max(0.5, 0.1 * height_mm)
    assert (soiled.soft_mm <= np.maximum(soiled.z_mm - deepest_mm, 0.0) + 1e-4).all()
    np.testing.assert_array_equal(soiled.clean_mm, clean.clean_mm)


@every_soil
def test_the_same_seed_lays_the_same(soil: str) -> None:
    first, again, other = (_laid(soil, 0.6, seed) for seed in (3, 3, 4))
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name), err_msg=name)
    assert (first.z_mm != other.z_mm).any()


@every_soil
def test_more_of_it_is_more(soil: str) -> None:
    clean = _coat().z_mm
    changes = [
        np.mean([np.abs(_soiled(soil, amount, seed).z_mm - clean).mean() for seed in range(3)])
        for amount in (0.05, 0.4, 1.0)
    ]
    assert all(b > a for a, b in pairwise(changes)), changes


@every_soil
def test_a_little_more_is_a_little_more(soil: str) -> None:
    """No jumps on the way from clean to filthy: a hundredth more moves the mean height by less than a tenth of all."""
    clean, whole = _coat().z_mm, np.abs(_soiled(soil, 1.0, 2).z_mm - _coat().z_mm).mean()
    assert np.abs(_soiled(soil, 0.01, 2).z_mm - clean).mean() < 0.1 * whole
    near = np.abs(_soiled(soil, 0.50, 2).z_mm - _soiled(soil, 0.51, 2).z_mm).mean()
    assert near < 0.1 * whole


def test_a_soil_lies_where_it_lay_when_another_comes_over_it() -> None:
    part = stamp("B4", pitch_mm=5.0 / 40, seed=5).stamped
    rng = [np.random.default_rng(8) for _ in range(2)]
    alone = soil_part(part, Soiling(("rust",), 0.5), rng=rng[0])
    under = soil_part(part, Soiling(("rust", "workshop"), 0.5), rng=rng[1])
    # scratches and pits only take, grime and paint only add: under them the rust is the same rust
    same = np.isclose(alone.height_map.z_mm, under.height_map.z_mm, atol=1e-6)
    assert same.mean() > 0.05


@pytest.mark.parametrize("name", ["mould", "glyphs.nowhere:soil", "glyphs.soiling.coat:nothing"])
def test_a_soil_that_is_not_there_is_named(name: str) -> None:
    with pytest.raises(StampError, match=name):
        Soiling((name,), 0.5)


def _dents(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    return replace(coat, z_mm=coat.z_mm - np.float32(0.1 * amount) * (coat.noise(1.0, rng) > 1.0))


def test_a_soil_of_ones_own() -> None:
    part = stamp("B4", pitch_mm=0.1, dirt=0.5, soil=f"{__name__}:_dents", seed=5)
    fall = part.stamped.height_map.z_mm - part.height_map.z_mm
    assert sorted(np.unique(fall.round(4))) == pytest.approx([0.0, 0.05], abs=2e-4)


def _broken(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    raise ZeroDivisionError("out of dirt")


def _nothing(coat: Coat, amount: float, *, rng: np.random.Generator) -> None:
    return None


def _smaller(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    return replace(coat, z_mm=coat.z_mm[::2])


@pytest.mark.parametrize(
    ("name", "said"),
    [("_broken", "ZeroDivisionError: out of dirt"), ("_nothing", "gives NoneType"), ("_smaller", "of shape")],
)
def test_a_soil_of_ones_own_that_fails_is_named(name: str, said: str) -> None:
    with pytest.raises(StampError, match=f"{name}.*{said}"):
        _ = stamp("B4", pitch_mm=0.1, dirt=0.5, soil=f"{__name__}:{name}", seed=5).height_map


# ---------------------------------------------------------------------------------------------------------- workshop

KINDS = tuple(f.name for f in fields(Dirt))
ADDED = ("grime", "oil", "swarf", "paint", "burr")
TAKEN = ("scratches", "pits")
STEEL = np.float32(0.2)


def _bare(raised: bool = False) -> StampedPart:
    return _stamped(raised)


@cache
def _stamped(raised: bool) -> StampedPart:
    return stamp("B4", pitch_mm=0.1, raised=raised, seed=5).stamped


def _dirtied(seed: int = 0, raised: bool = False, **amounts: float) -> SoiledPart:
    return soil_part(_bare(raised), Soiling(mixture=Dirt(**amounts)), rng=np.random.default_rng(seed))


def _rise(soiled: SoiledPart) -> np.ndarray:
    return soiled.height_map.z_mm - soiled.part.height_map.z_mm


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("raised", [False, True])
def test_every_kind_alone_only_adds_or_only_takes(kind: str, raised: bool) -> None:
    rise = np.stack([_rise(_dirtied(seed, raised, **{kind: 0.8})) for seed in range(3)])
    assert np.isfinite(rise).all()
    # float32 heights of a few tenths of a millimetre: sums are exact to about 1e-7
    if kind in ADDED:
        assert rise.min() >= -1e-6
        assert rise.max() > 0.003
    else:
        assert kind in TAKEN
        assert rise.max() <= 1e-6
        assert rise.min() < -0.003


@given(seed=st.integers(0, 2**32), severity=st.floats(0.0, 1.0))
@settings(max_examples=12, deadline=None)
def test_what_yields_lies_on_what_was_there(seed: int, severity: float) -> None:
    soiled = soil_part(_bare(), Soiling(severity=severity), rng=np.random.default_rng(seed))
    bottom = soiled.height_map.z_mm - soiled.soil.thickness_mm
    deepest_cut = 0.12 + 0.04  # a pit and a scratch in it
    assert (bottom >= _bare().height_map.z_mm - deepest_cut - 1e-6).all()
    assert (soiled.height_map.z_mm <= _bare().height_map.z_mm.max() + 0.25 + HIGHEST_MM).all()
    soft = soiled.soil.thickness_mm > 0.0
    assert (soiled.soil.hardness_mpa[soft] <= PAINT_MPA).all()
    assert (soiled.soil.friction >= OIL_FRICTION - 1e-6).all()
    assert (soiled.soil.friction <= 0.5).all()


@pytest.mark.parametrize(
    ("kind", "soft", "slippery"),
    [
        ("grime", True, False),
        ("oil", True, True),
        ("paint", True, False),
        ("swarf", False, False),
        ("scratches", False, False),
        ("pits", False, False),
        ("burr", False, False),
    ],
)
def test_each_kind_changes_what_it_says(kind: str, soft: bool, slippery: bool) -> None:
    # a single part may have none of it on so small a plate: look at a few
    several = [_dirtied(seed, **{kind: 0.9}) for seed in range(4)]
    assert any(s.soil.thickness_mm.any() for s in several) == soft
    assert any((s.soil.friction < STEEL - 0.05).any() for s in several) == slippery
    clean = _dirtied(0)
    assert any((s.look.albedo != clean.look.albedo).any() for s in several) or kind == "burr"
    for s in several:
        untouched = (_rise(s) == 0.0) & (s.soil.thickness_mm == 0.0) & (s.soil.friction == STEEL)
        assert (s.soil.hardness_mpa[untouched] == clean.soil.hardness_mpa[0, 0]).all()
    if kind in ("swarf", "scratches", "burr"):
        for s in several:
            np.testing.assert_array_equal(s.soil.friction, STEEL)


def test_grime_fills_grooves_and_is_as_hard_as_it_says() -> None:
    depth = -_bare().height_map.z_mm
    in_groove, on_land = depth > 0.12, depth < 0.01
    filled, smeared, hardness = [], [], []
    for seed in range(6):
        caked = _dirtied(seed, grime=0.7)
        thick = caked.soil.thickness_mm
        filled.append(thick[in_groove].mean())
        smeared.append(thick[on_land].mean())
        hardness.append(caked.soil.hardness_mpa[thick > 0.0])
        # to the brim and a little over it: never a heap
        assert thick.max() < depth.max() * 1.3 + 0.12
        np.testing.assert_allclose(thick, _rise(caked), atol=1e-3)
    assert np.mean(filled) > 3.0 * np.mean(smeared)
    every = np.concatenate(hardness)
    assert every.min() >= SOFTEST_MPA
    assert every.max() <= HARDEST_MPA
    assert every.max() > 2.0 * every.min()


def test_burr_rises_beside_the_marks_alone() -> None:
    rise = _rise(_dirtied(burr=1.0))
    near = np.zeros(rise.shape, dtype=bool)
    for x0, y0, x1, y1 in _bare().boxes_mm:
        # the rim is 0.06 heights wide, and starts outside the box by no more than a burr of the stamping
        near[
            int((y0 - 0.6) / 0.1) : int((y1 + 0.6) / 0.1) + 2,
            int((x0 - 0.6) / 0.1) : int((x1 + 0.6) / 0.1) + 2,
        ] = 1
    assert (rise[~near] == 0.0).all()
    assert rise[near].max() > 0.005


def test_one_kind_does_not_move_another() -> None:
    alone, beside, swarf = (
        _dirtied(2, scratches=0.5),
        _dirtied(2, scratches=0.5, swarf=0.3),
        _dirtied(2, swarf=0.3),
    )
    # swarf rests on what is there, a scratch perhaps: elsewhere the scratches are the same
    bare = (beside.look.albedo == alone.look.albedo).all(axis=2)
    np.testing.assert_array_equal(_rise(alone)[bare], _rise(beside)[bare])
    lies = _rise(swarf) > 0.0
    assert lies.any()
    assert (_rise(beside) > 0.0)[lies].mean() > 0.9


def test_a_surface_with_holes_is_refused() -> None:
    z = _bare().height_map.z_mm.copy()
    z[4, 4] = np.nan
    holed = StampedPart(HeightMap(z, 0.1), "B4", 5.0, _bare().boxes_mm, "gothic")
    with pytest.raises(MapError, match="dropouts"):
        soil_part(holed, Soiling(severity=0.5), rng=np.random.default_rng(0))


@pytest.mark.parametrize("length_mm", [0.3, 1.0])
def test_noise_has_the_length_and_the_spread_it_says(length_mm: float) -> None:
    noise = smooth_noise((400, 500), pitch_mm=0.1, length_mm=length_mm, rng=np.random.default_rng(1))
    lag = round(length_mm / 0.1)
    # some 50 x 40 mm / (2 L)^2 independent patches: 500 for the longer one, so a standard error near 0.05
    assert noise.std() == pytest.approx(1.0, abs=0.12)
    fall = float(np.mean(noise[:, lag:] * noise[:, :-lag]) / np.mean(noise**2))
    assert fall == pytest.approx(np.exp(-1.0), abs=0.1)
    assert float((share(noise) > 0.7).mean()) == pytest.approx(0.3, abs=0.06)
