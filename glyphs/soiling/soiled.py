"""Dirty parts: one soiled surface for touch and camera.

StampedPart --soil_part--> SoiledPart --photograph--> Photo     (glyphs.camera.appearance)
                               |
                               +---- height_map, soil --> touch
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated
from zlib import crc32

import numpy as np

from glyphs.ranges import Range, Validated
from glyphs.soiling.coat import Coat, Look, bare_coat
from glyphs.soiling.severity import amount_of
from glyphs.soiling.soil import Soil
from glyphs.soiling.soils import SOILS, soil_model
from glyphs.soiling.workshop.mixture import Dirt, lay_mixture
from glyphs.stamping.errors import StampError
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap

WORKSHOP = "workshop"
_LOOK_STREAM = 7
"""Random stream of the bare metal's look; the workshop's seven kinds of dirt use the streams before it."""


@dataclass(frozen=True, repr=False)
class Soiling(OneLine, Validated, error=StampError):
    """The soils of a part and their severity. Raises StampError.

    Attributes:
        soils: names of soils, the bottom layer first; each has the same amount as it would have alone.
        severity: 0 (clean) to 1, equally hard to read for every soil (`glyphs.soiling.severity`).
        mixture: amounts of the workshop's seven kinds; default: the usual mixture at the severity.
    """

    soils: tuple[str, ...] = (WORKSHOP,)
    severity: Annotated[float, Range(0.0, 1.0, "it lies between 0 (clean) and 1")] = 0.0
    mixture: Dirt | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.soils or len(set(self.soils)) != len(self.soils):
            raise StampError(f"the soils are {self.soils}", hint="name at least one, each once")
        for name in self.soils:
            soil_model(name)
        if self.mixture is not None and self.soils != (WORKSHOP,):
            raise StampError(
                f"a mixture of the workshop's kinds cannot be combined with {', '.join(self.soils)}",
                hint="give either amounts of these kinds, or other soils",
            )

    @property
    def clean(self) -> bool:
        return self.severity == 0.0 if self.mixture is None else self.mixture.clean


@dataclass(frozen=True, eq=False, repr=False)
class SoiledPart(OneLine):
    """A part with its soil. Raises ValueError: grids that do not agree."""

    part: StampedPart
    height_map: HeightMap
    soil: Soil
    look: Look

    def __post_init__(self) -> None:
        shapes = {self.part.height_map.shape, self.height_map.shape, self.soil.shape}
        if len(shapes | {np.shape(self.look.roughness)}) != 1:
            raise ValueError(f"the grids of a soiled part differ: {shapes}")


def soil_part(part: StampedPart, soiling: Soiling, *, rng: np.random.Generator) -> SoiledPart:
    """Soil a part; every soil has its own random stream, named after it. Raises MapError, StampError."""
    seed = rng.bit_generator.seed_seq
    assert isinstance(seed, np.random.SeedSequence)
    before = seed.n_children_spawned
    coat = bare_coat(part, rng=rng.spawn(_LOOK_STREAM + 1)[_LOOK_STREAM])
    if not soiling.clean:
        for name in soiling.soils:
            stream = _stream(seed, before, name)
            if soiling.mixture is not None:
                coat = lay_mixture(coat, soiling.mixture, rng=stream)
            else:
                coat = _lay_soil(coat, name, amount_of(name, soiling.severity), rng=stream)
    return SoiledPart(
        part=part,
        height_map=part.height_map if soiling.clean else HeightMap(coat.z_mm, coat.pitch_mm),
        soil=Soil(coat.soft_mm, coat.hardness_mpa, coat.friction),
        look=Look(coat.albedo, coat.roughness, coat.reflectance),
    )


def _lay_soil(coat: Coat, name: str, amount: float, *, rng: np.random.Generator) -> Coat:
    model = soil_model(name)
    if name in SOILS:
        return model(coat, amount, rng=rng)
    try:
        laid = model(coat, amount, rng=rng)
    except Exception as error:
        raise StampError(
            f"the soil {name!r} failed ({type(error).__name__}: {error})", hint="correct it"
        ) from error
    if not isinstance(laid, Coat) or np.shape(laid.z_mm) != coat.shape:
        what = f"a surface of shape {np.shape(laid.z_mm)}" if isinstance(laid, Coat) else type(laid).__name__
        raise StampError(f"the soil {name!r} gives {what}", hint=f"give a Coat of shape {coat.shape}")
    return laid


def _stream(seed: np.random.SeedSequence, before: int, soil: str) -> np.random.Generator:
    key = seed.spawn_key
    if soil != WORKSHOP:
        key, before = (*key, before, crc32(soil.encode())), 0
    return np.random.default_rng(
        np.random.SeedSequence(seed.entropy, spawn_key=key, n_children_spawned=before)
    )
