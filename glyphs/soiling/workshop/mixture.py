"""The workshop's dirt, in this order: burr (of stamping), pits, scratches, paint, grime, oil, swarf."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from glyphs.ranges import Range, Share, Validated, require_range
from glyphs.soiling.coat import Coat
from glyphs.soiling.workshop.damage import add_burr, add_pits, add_scratches
from glyphs.soiling.workshop.debris import add_swarf
from glyphs.soiling.workshop.films import add_oil, add_paint
from glyphs.soiling.workshop.grime import add_grime
from glyphs.stamping.errors import StampError
from glyphs.surface.display import OneLine

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


@dataclass(frozen=True, repr=False)
class Dirt(OneLine, Validated, error=StampError):
    """Mean amount of each kind over parts, 0 to 1; one part has 0.4 to 1.6 times as much. Raises StampError."""

    grime: Share = 0.0
    oil: Share = 0.0
    swarf: Share = 0.0
    scratches: Share = 0.0
    pits: Share = 0.0
    paint: Share = 0.0
    burr: Share = 0.0

    @classmethod
    def of(cls, severity: float) -> Dirt:
        """Return the usual mixture for a severity, 0 (clean) to 1. Raises StampError: a severity outside 0..1."""
        require_range(StampError, Range(0.0, 1.0), severity=severity)
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
        return not any(getattr(self, item.name) for item in fields(self))


def workshop(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Soil a surface with the usual mixture for a severity (a `SoilModel`)."""
    return lay_mixture(coat, Dirt.of(amount), rng=rng)


def lay_mixture(coat: Coat, dirt: Dirt, *, rng: np.random.Generator) -> Coat:
    """Lay a mixture on a surface; every kind has its own random stream, so that more of one moves no other."""
    for (name, layer), stream in zip(_LAYERS, rng.spawn(len(_LAYERS)), strict=True):
        amount = min(1.0, getattr(dirt, name) * stream.uniform(_LEAST, _MOST))
        if amount > 0.0:
            coat = layer(coat, amount, rng=stream)
    return coat
