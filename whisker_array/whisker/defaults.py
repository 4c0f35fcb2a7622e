"""Default whisker, preload and tip, in proportion to the character height."""

from __future__ import annotations

from dataclasses import replace

from glyphs.ranges import require_positive
from whisker_array.whisker.sections import MUSIC_WIRE, Rectangle, WhiskerError
from whisker_array.whisker.shapes import LShaped

NOMINAL_FRICTION = 0.2
"""Steel on clean steel is 0.1 to 0.5 (physics.md); the stage is set up at this one."""
TIP_RADIUS_HEIGHTS = 0.012
"""Default ball radius in character heights: 0.06 mm at 5 mm, fine enough for a stroke of h/14."""
DEFAULT_K = 0.117
"""The strongest differentiator of the paper's experiments."""


def default_whisker(character_height_mm: float) -> LShaped:
    """A ribbon L-shaped whisker for characters of this height H, every dimension in proportion to H.

    l1 = 6 H, k = 0.117, beta = 0, l3 = l2; music-wire ribbon 0.06 H thick and 0.9 H wide. The width
    is set by the lateral stiffness: what counts sideways is I/I' (1 + k^3) + 3 k^2 EI/GJ, and the twist of l1
    under the tip arm leaves a ratio Dyy/Dzz of at most 38 however wide the ribbon (17 at 6 thicknesses, 31 at
    15). Stress on the land is about 5 % of yield at every H; natural frequency goes as 1/H, moment as H^3.

    Raises:
        WhiskerError: a height that is not positive.
    """
    require_positive(WhiskerError, character_height_mm=character_height_mm)
    h = character_height_mm
    return LShaped(
        l1_mm=6.0 * h,
        l2_mm=6.0 * h * DEFAULT_K,
        l3_mm=None,
        beta_rad=0.0,
        section=Rectangle(thickness_mm=0.06 * h, width_mm=0.9 * h),
        material=MUSIC_WIRE,
    )


def default_preload_mm(character_height_mm: float) -> float:
    """Preload depth d0 = 0.2 H, mm: four to six times the usual mark depth."""
    require_positive(WhiskerError, character_height_mm=character_height_mm)
    return 0.2 * character_height_mm


def profiling_whisker(character_height_mm: float) -> LShaped:
    """The default whisker with its sensor raised by l2 / 2 above the clamp: F = 1, as for a straight one.

    With l3 = -l2 / 2 the two factors of (22) are the same for every slope and friction, so the moment is the
    profile (Case study 1), and the tip moves exactly as the differentiators' do. A truly straight whisker is a
    profilometer too but cannot follow steep marks: its shaft clears a rising wall only if beta is above
    alpha, and it is lifted by a falling one only if alpha + beta is below 90 degrees and the angle of friction.

    Raises:
        WhiskerError: a height that is not positive.
    """
    whisker = default_whisker(character_height_mm)
    return replace(whisker, l3_mm=-0.5 * whisker.l2_mm)
