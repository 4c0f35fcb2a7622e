"""Touch of a whisker: tip, preload, ball and friction. With the surface they determine the moments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from glyphs.ranges import NotNegative, Positive, Range, Validated
from glyphs.surface.display import OneLine
from whisker_array.whisker.defaults import (
    NOMINAL_FRICTION,
    TIP_RADIUS_HEIGHTS,
    default_preload_mm,
    default_whisker,
    profiling_whisker,
)
from whisker_array.whisker.ringing import Ringing, ringing_of
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import TipModel, Whisker

MOST_PRELOAD_MM = 1000.0
"""Greatest preload, beyond that of any whisker; simulated contact searches the surface as far as the preload."""


@dataclass(frozen=True, eq=False, repr=False)
class Touch(OneLine, Validated, error=WhiskerError):
    """Touch of a whisker: tip, preload d0, ball, nominal friction, and ringing (unknown: as on a slow stage)."""

    tip: TipModel
    preload_mm: Annotated[Positive, Range(0.0, MOST_PRELOAD_MM)]
    tip_radius_mm: NotNegative
    friction: Annotated[float, Range(0.0, 2.0)] = NOMINAL_FRICTION
    whisker: str = ""
    ringing: Ringing | None = None

    def land_moment_n_mm(self) -> float:
        """Moment on flat land at the nominal friction, eq. (14) with alpha = 0."""
        force = np.array([-self.friction, 1.0, 0.0])
        normal = self.preload_mm / float(self.tip.compliance_mm_per_n[1] @ force)
        return normal * float(self.tip.moment_arm_mm @ force)

    @classmethod
    def of(cls, whisker: Whisker, **use: float) -> Touch:
        """Touch of a drawn whisker; `use` is preload_mm, tip_radius_mm and friction."""
        return cls(whisker.tip_model(), whisker=whisker.describe(), ringing=ringing_of(whisker), **use)

    def with_whisker(self, whisker: Whisker) -> Touch:
        use = {"preload_mm": self.preload_mm, "tip_radius_mm": self.tip_radius_mm, "friction": self.friction}
        return Touch.of(whisker, **use)


def default_touch(character_height_mm: float, *, friction: float = NOMINAL_FRICTION) -> Touch:
    """Touch of the default ribbon whisker, scaled to the character height, with a preload of 0.2 of that height."""
    return Touch.of(
        default_whisker(character_height_mm),
        preload_mm=default_preload_mm(character_height_mm),
        tip_radius_mm=TIP_RADIUS_HEIGHTS * character_height_mm,
        friction=friction,
    )


def profiling_touch(character_height_mm: float, *, friction: float = NOMINAL_FRICTION) -> Touch:
    """Default touch with the sensor placed so that the moment is the profile, for a second comb."""
    touch = default_touch(character_height_mm, friction=friction)
    return touch.with_whisker(profiling_whisker(character_height_mm))
