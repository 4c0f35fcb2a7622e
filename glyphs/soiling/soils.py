"""Soils by name: each is a physical model behind one function.

    coat, amount, rng --SoilModel--> coat      the new top, the soft dirt in it, and its look

A user's own soil is any such function, named `module:function`.
"""

from __future__ import annotations

from typing import Final, Protocol, cast

import numpy as np

from glyphs.named import load_named
from glyphs.soiling.coat import Coat
from glyphs.stamping.errors import StampError


class SoilModel(Protocol):
    """A kind of soil: a function from one surface to the next.

    - Amount 0 changes nothing; at 1 hardly a character can be read. Dirt only grows with the amount: the same `rng`
      gives the same patches, larger.
    - `z_mm` is the new top. Dirt that yields under a tip has `soft_mm` and `hardness_mpa`; hard dirt has no `soft_mm`.
    - All arrays keep shape and dtype (float32) and stay finite.
    - `rng` is the only source of randomness.
    """

    def __call__(self, coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
        """Soil a surface; `amount` is 0 to 1."""


SOILS: Final[dict[str, str]] = {
    "workshop": "glyphs.soiling.workshop.mixture:workshop",
    "caked": "glyphs.soiling.caked:caked",
    "rust": "glyphs.soiling.rust.corrosion:rust",
    "paint": "glyphs.soiling.paint.coats:paint",
    "weld": "glyphs.soiling.weld.plate:weld",
    "mud": "glyphs.soiling.mud.sheets:mud",
    "wear": "glyphs.soiling.wear.rubbing:wear",
    "casting": "glyphs.soiling.casting.pour:casting",
}


def soil_model(name: str) -> SoilModel:
    """Return the soil of a name or of `module:function`. Raises StampError: an unknown soil, module or function."""
    place = SOILS.get(name, name)
    if ":" not in place:
        raise StampError(
            f"there is no soil {name!r}",
            hint=f"use one of {', '.join(SOILS)}, or your own module:function",
        )
    return cast(SoilModel, load_named(place, what="soil", error=StampError))
