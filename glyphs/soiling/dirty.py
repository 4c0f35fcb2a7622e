"""Dirty parts: one soiled surface that is both felt and photographed.

    StampedPart --soil_part--> SoiledPart --photograph--> Photo     (glyphs.camera.appearance)
                                   |
                                   +---- height_map, soil --> touch

Order of what happens to a part: burr (when it is stamped), pits, scratches, paint, grime, oil, swarf.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from glyphs.soiling.coat import Coat, Look, bare_coat
from glyphs.soiling.debris import add_swarf
from glyphs.soiling.films import add_oil, add_paint
from glyphs.soiling.grime import add_grime
from glyphs.soiling.soil import Soil
from glyphs.soiling.wear import add_burr, add_pits, add_scratches
from glyphs.stamping.stamp import StampedPart
from glyphs.stamping.variation import StampError
from glyphs.surface.display import one_line
from glyphs.surface.maps import HeightMap

__all__ = ["Dirt", "Look", "SoiledPart", "StampError", "soil_part"]

Layer = Callable[..., Coat]
_LAYERS: Final[tuple[tuple[str, Layer], ...]] = (
    ("burr", add_burr),
    ("pits", add_pits),
    ("scratches", add_scratches),
    ("paint", add_paint),
    ("grime", add_grime),
    ("oil", add_oil),
    ("swarf", add_swarf),
)
_LEAST, _MOST = 0.4, 1.6


@dataclass(frozen=True)
class Dirt:
    """How much of each kind, 0 (none) to 1: the mean over parts; a single part has 0.4 to 1.6 times as much.

    Attributes:
        grime: caked into grooves and smeared over the land; yields to a hard push.
        oil: slippery, darker and glossy patches.
        swarf: curls, slivers and grains of hard metal on the surface.
        scratches: narrow grooves in any direction.
        pits: corrosion, rusty and rough.
        paint: a hard film that levels grooves, chipped in places.
        burr: a rim along the marks, beyond the one from the stamping itself.

    Raises:
        StampError: an amount outside 0..1.
    """

    grime: float = 0.0
    oil: float = 0.0
    swarf: float = 0.0
    scratches: float = 0.0
    pits: float = 0.0
    paint: float = 0.0
    burr: float = 0.0

    __repr__ = one_line

    def __post_init__(self) -> None:
        for item in fields(self):
            amount = getattr(self, item.name)
            if not (math.isfinite(amount) and 0.0 <= amount <= 1.0):
                raise StampError(f"{item.name} is {amount}", hint="it lies between 0 (none) and 1")

    @classmethod
    def of(cls, severity: float) -> Dirt:
        """The usual mixture for one severity, 0 (clean) to 1.

        Raises:
            StampError: a severity outside 0..1.
        """
        if not (math.isfinite(severity) and 0.0 <= severity <= 1.0):
            raise StampError(f"the severity is {severity}", hint="it lies between 0 (clean) and 1")
        s = severity
        return cls(
            grime=s**1.5,
            oil=0.8 * s,
            swarf=s**2,
            scratches=s,
            pits=0.8 * s**1.5,
            paint=0.45 * s**2,
            burr=0.6 * s,
        )

    @property
    def clean(self) -> bool:
        """Whether there is none at all."""
        return not any(getattr(self, item.name) for item in fields(self))


@dataclass(frozen=True, eq=False)
class SoiledPart:
    """A part with what lies on it.

    Attributes:
        part: the part when it was clean.
        height_map: the top of its surface now.
        soil: what of it yields, and its friction.
        look: how it throws light back.

    Raises:
        ValueError: grids that do not agree.
    """

    part: StampedPart
    height_map: HeightMap
    soil: Soil
    look: Look

    __repr__ = one_line

    def __post_init__(self) -> None:
        shapes = {self.part.height_map.shape, self.height_map.shape, self.soil.shape}
        if len(shapes | {np.shape(self.look.roughness)}) != 1:
            raise ValueError(f"the grids of a soiled part differ: {shapes}")


def soil_part(part: StampedPart, dirt: Dirt, *, rng: np.random.Generator) -> SoiledPart:
    """Soil a part.

    Every kind draws from a stream of its own, and the same whatever its amount: so more grime leaves the
    scratches where they were, and patches of grime grow.

    Args:
        part: the stamped part.
        dirt: how much of what.
        rng: the only source of randomness; the same state gives the same dirt.

    Raises:
        MapError: dropouts in the part's height map.
    """
    streams = rng.spawn(len(_LAYERS) + 1)
    coat = bare_coat(part, rng=streams[-1])
    for (name, layer), stream in zip(_LAYERS, streams, strict=False):
        amount = min(1.0, getattr(dirt, name) * stream.uniform(_LEAST, _MOST))
        if amount > 0.0:
            coat = layer(coat, amount, rng=stream)
    return SoiledPart(
        part=part,
        height_map=part.height_map if dirt.clean else HeightMap(coat.z_mm, coat.pitch_mm),
        soil=Soil(coat.soft_mm, coat.hardness_mpa, coat.friction),
        look=Look(coat.albedo, coat.roughness, coat.reflectance),
    )
