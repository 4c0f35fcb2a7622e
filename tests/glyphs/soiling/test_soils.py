"""What every soil keeps to, whatever it is made of."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
import pytest

from glyphs import stamp
from glyphs.soiling.coat import Coat
from glyphs.soiling.soiled import Soiling, soil_part
from glyphs.soiling.soils import SOILS, soil_model
from glyphs.stamping.errors import StampError
from tests.support.coats import bare_part

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
@pytest.mark.parametrize("amount", [0.1, 0.5, 1.0])
@pytest.mark.parametrize(("raised", "height_mm"), [(False, 5.0), (True, 5.0), (False, 2.0), (False, 12.0)])
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
