"""Dies by name: their edge, and their effect on the metal beside the groove."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import WIDEST, Die, Face, default_die, nominal_stroke_mm
from glyphs.stamping.variation import StampingVariation


@dataclass(frozen=True)
class DieKind:
    """One kind of die."""

    face: Face
    # blunt V only (`face` is FLAT): width of the flat at its edge, as a share of the usual stroke; 0: an ordinary die
    # of its face. Outlined fonts keep their own widths; the flat appears where they are wide enough.
    tip: float = 0.0
    changes: tuple[tuple[str, float], ...] = ()

    def die(
        self,
        height_mm: float,
        *,
        font: Font | None = None,
        bevel_deg: float = 45.0,
        depth_mm: float | None = None,
    ) -> Die:
        """Die for a character height; arguments and errors as in `default_die`."""
        usual = default_die(height_mm, font=font, face=self.face, bevel_deg=bevel_deg, depth_mm=depth_mm)
        if self.tip == 0.0:
            return usual
        nominal = nominal_stroke_mm(height_mm, font)
        walls = 2 * usual.depth_mm / math.tan(math.radians(bevel_deg))
        stroke = min(self.tip * nominal + walls, WIDEST * nominal)
        return replace(usual, stroke_mm=stroke, root_radius_mm=0.05 * usual.depth_mm)

    def applied(self, how: StampingVariation) -> StampingVariation:
        return replace(how, **dict(self.changes))  # type: ignore[arg-type]


DIES: Final[dict[str, DieKind]] = {
    "flat": DieKind(Face.FLAT),
    "sharp": DieKind(Face.SHARP),
    "blunt-v": DieKind(Face.FLAT, tip=0.2),
    "round": DieKind(Face.ROUND),
    "dotted": DieKind(Face.DOTTED),
    "lopsided": DieKind(Face.FLAT, changes=(("burr_fraction", 0.25), ("pile_up_lean", 0.9))),
    "double": DieKind(
        Face.FLAT, changes=(("double_strike_probability", 0.5), ("double_strike_fraction", 0.07))
    ),
    "one-flank": DieKind(Face.FLAT, changes=(("flank_loss", 1.0),)),
}
"""`flat` is the default. `blunt-v` is a V with a flat of a fifth of the stroke, `lopsided` piles metal up on one side,
`double` strikes about half of the characters twice, at random, and `one-flank` leaves out the wall on one side."""
