"""How stamped plates differ: the plate's own form and texture, and how one blow differs from the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

from glyphs.errors import MarksError
from glyphs.surface.display import one_line


class StampError(MarksError):
    """A variation that cannot be: the message names the field and its range."""


def check_amounts(values: object, *, positive: tuple[str, ...] = (), signed: tuple[str, ...] = ()) -> None:
    """Check every float field of a dataclass: finite, at least zero unless `signed`, above it if `positive`.

    Raises:
        StampError: a field out of range.
    """
    for item in fields(values):  # type: ignore[arg-type]
        value = getattr(values, item.name)
        if not isinstance(value, (int, float)):
            continue
        if not math.isfinite(value):
            raise StampError(f"{item.name} is {value}", hint="it must be finite")
        if item.name in positive and value <= 0.0:
            raise StampError(f"{item.name} is {value}", hint="it must be positive")
        if item.name not in signed and value < 0.0:
            raise StampError(f"{item.name} is {value}", hint="it must be zero or positive")


@dataclass(frozen=True)
class PlateVariation:
    """How far a plate is from flat; the defaults are those of a machined (turned, milled or ground) one.

    Attributes:
        tilt_deg: standard deviation of the tilt about either axis, degrees.
        waviness_um: amplitude of the waviness, micrometres.
        waviness_wavelength_mm: its wavelength, > 0.
        lay_um: amplitude of the machining lay, micrometres.
        lay_wavelength_mm: feed of the tool, > 0.
        lay_direction_deg: direction in which the lay's ridges run, degrees of the plate frame.
        lay_jitter: wander of the lay's phase, radians (standard deviation over the plate).
        roughness_ra_um: arithmetic mean roughness Ra, micrometres.
        roughness_length_mm: distance at which its autocorrelation has fallen to 1/e, > 0.
        ironing: part of lay and roughness that the die presses flat on the floor of a mark, 0..1.

    Raises:
        StampError: a value out of range.
    """

    tilt_deg: float = 0.2
    waviness_um: float = 10.0
    waviness_wavelength_mm: float = 12.0
    lay_um: float = 2.0
    lay_wavelength_mm: float = 0.25
    lay_direction_deg: float = 90.0
    lay_jitter: float = 0.8
    roughness_ra_um: float = 1.0
    roughness_length_mm: float = 0.06
    ironing: float = 0.7

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_amounts(
            self,
            positive=("waviness_wavelength_mm", "lay_wavelength_mm", "roughness_length_mm"),
            signed=("lay_direction_deg",),
        )
        if self.ironing > 1.0:
            raise StampError(f"ironing is {self.ironing}", hint="it is a fraction between 0 and 1")

    @classmethod
    def none(cls) -> PlateVariation:
        """A perfectly flat and smooth plate."""
        return cls(
            tilt_deg=0.0, waviness_um=0.0, lay_um=0.0, lay_jitter=0.0, roughness_ra_um=0.0, ironing=0.0
        )


@dataclass(frozen=True)
class StampingVariation:
    """What a hammer does differently at every blow. Standard deviations unless said otherwise.

    Attributes:
        depth_fraction: depth, as a fraction of the die's; clipped at 2.5 deviations.
        tilt_fraction: change of depth across one cap height, as a fraction of the depth, either axis.
        rotation_deg: rotation of a character.
        baseline_fraction: rise over the baseline, fraction of the height.
        spacing_fraction: place along the line, fraction of the height.
        worn_probability: probability that a character's die is worn: rounder, shallower, one side faint.
        double_strike_probability: probability of a second, shallower blow beside the first.
        double_strike_fraction: distance of that blow, fraction of the height.
        burr_fraction: mean height of the burr raised beyond the die's own, fraction of the depth.
        plate: the plate.

    Raises:
        StampError: a value out of range.
    """

    depth_fraction: float = 0.12
    tilt_fraction: float = 0.12
    rotation_deg: float = 1.2
    baseline_fraction: float = 0.02
    spacing_fraction: float = 0.03
    worn_probability: float = 0.05
    double_strike_probability: float = 0.02
    double_strike_fraction: float = 0.05
    burr_fraction: float = 0.08
    plate: PlateVariation = field(default_factory=PlateVariation)

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_amounts(self)
        for name in ("worn_probability", "double_strike_probability"):
            if getattr(self, name) > 1.0:
                raise StampError(
                    f"{name} is {getattr(self, name)}", hint="it is a probability between 0 and 1"
                )

    @classmethod
    def none(cls) -> StampingVariation:
        """A faultless press on a perfect plate: the relief is the ideal one."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, PlateVariation.none())
