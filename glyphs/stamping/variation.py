"""Variation of stamped plates: form and texture of the plate, and differences from blow to blow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from glyphs.ranges import Finite, NotNegative, Positive, Share, Validated
from glyphs.stamping.errors import StampError
from glyphs.stamping.forms import PlateForm
from glyphs.stamping.textures import Texture
from glyphs.surface.display import OneLine


@dataclass(frozen=True, repr=False)
class PlateVariation(OneLine, Validated, error=StampError):
    """Deviation of a plate from flat; by default machined (turned, milled or ground). Raises StampError.

    Attributes:
        lay_direction_deg: direction in which the lay's ridges run, degrees of the plate frame.
        lay_jitter: wander of the lay's phase, radians (standard deviation over the plate).
        ironing: share of lay and roughness that the die presses flat on the floor of a mark, 0..1.
    """

    tilt_deg: NotNegative = 0.2
    waviness_um: NotNegative = 10.0
    waviness_wavelength_mm: Positive = 12.0
    lay_um: NotNegative = 2.0
    lay_wavelength_mm: Positive = 0.25
    lay_direction_deg: Finite = 90.0
    lay_jitter: NotNegative = 0.8
    roughness_ra_um: NotNegative = 1.0
    roughness_length_mm: Positive = 0.06
    ironing: Share = 0.7
    form: PlateForm = field(default_factory=PlateForm)
    texture: Texture | None = None

    @classmethod
    def none(cls) -> PlateVariation:
        return cls(
            tilt_deg=0.0, waviness_um=0.0, lay_um=0.0, lay_jitter=0.0, roughness_ra_um=0.0, ironing=0.0
        )


@dataclass(frozen=True, repr=False)
class StampingVariation(OneLine, Validated, error=StampError):
    """Variation from blow to blow; numbers are standard deviations unless noted. Raises StampError.

    Attributes:
        depth_fraction: depth, as a fraction of the die's; clipped at 2.5 deviations.
        tilt_fraction: change of depth across one cap height, as a fraction of the depth, either axis.
        burr_fraction: mean height of the burr in addition to the die's own, fraction of the depth.
        pile_up_lean: asymmetry of the burr, 0..1: higher by this share on the side to which a blow leans, lower by it
            on the other.
        flank_loss: share of the depth that is missing at the wall to which a blow leans, 0..1; at 1 that wall is
            missing.
    """

    depth_fraction: NotNegative = 0.12
    tilt_fraction: NotNegative = 0.12
    rotation_deg: NotNegative = 1.2
    baseline_fraction: NotNegative = 0.02
    spacing_fraction: NotNegative = 0.03
    worn_probability: Share = 0.05
    double_strike_probability: Share = 0.02
    double_strike_fraction: NotNegative = 0.05
    burr_fraction: NotNegative = 0.08
    plate: PlateVariation = field(default_factory=PlateVariation)
    pile_up_lean: Share = 0.0
    flank_loss: Share = 0.0
    jump_probability: Share = 0.0
    jump_fraction: NotNegative = 0.0

    @classmethod
    def none(cls) -> StampingVariation:
        """A perfect press on a perfect plate: the relief is ideal."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, PlateVariation.none())

    @classmethod
    def hand(cls) -> StampingVariation:
        """Single stamps, held by hand and struck with a hammer: gaps, tilts and rotations are about twice those of a
        holder, blows differ in force, and the baseline jumps where the hand is set down again."""
        return cls(
            depth_fraction=0.2,
            tilt_fraction=0.25,
            rotation_deg=2.5,
            baseline_fraction=0.045,
            spacing_fraction=0.06,
            worn_probability=0.08,
            double_strike_probability=0.06,
            burr_fraction=0.12,
            pile_up_lean=0.3,
            jump_probability=0.25,
            jump_fraction=0.08,
        )


PRACTICES: Final[dict[str, Callable[[], StampingVariation]]] = {
    "press": StampingVariation,
    "hand": StampingVariation.hand,
    "ideal": StampingVariation.none,
}
"""Ways of stamping: a press or a holder (the default), single stamps by hand, and ideal marks."""
