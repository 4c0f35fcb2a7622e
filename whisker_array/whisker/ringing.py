r"""How a whisker with mass rings while its tip slides over a profile.

      base o=======================.       tip on the surface: it follows h(t), and the beam swings at `held_hz`
            \__  swings  ___/      |       between clamp and tip
               '--------'          o       corners of h strike it: the tip changes its speed at once

The profile (1 + h/d0) of the land's moment then lacks `gain` times that part of h which the beam cannot follow
(`whisker_array.simulation.at_speed`).
"""

from __future__ import annotations

from dataclasses import dataclass

from glyphs.ranges import NotNegative, Positive, Validated
from glyphs.surface.display import OneLine
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.validity import first_bending_frequency_hz


@dataclass(frozen=True, repr=False)
class Ringing(OneLine, Validated, error=WhiskerError):
    """First frequency in the plane of tracing with the tip on the surface, gain, and share of critical damping, which
    is assumed: clamped steel springs without dampers have 0.2 to 2 %."""

    held_hz: Positive
    gain: NotNegative
    damping: NotNegative = 0.01


def ringing_of(whisker: Whisker, *, straight: float = 4.2, foot: float = 40.0) -> Ringing:
    """Compute the ringing of a whisker; `straight` and `foot` were fitted to whiskers with mass.

    The gain is straight (1 + foot k^1.5): with mass, straight whiskers have 4.2 to 4.5, and those of k = 0.033, 0.083,
    0.117, 0.15 and 0.2 have 5.0, 8.2, 10.9, 15.8 and 19.7 (`python -m tests.proof.small_model`).
    """
    hz = first_bending_frequency_hz(whisker, tip_held=True, in_plane=True, parts=8)
    return Ringing(held_hz=hz, gain=straight * (1.0 + foot * max(whisker.k, 0.0) ** 1.5))
