"""Default whisker, preload and tip, in proportion to the character height."""

from __future__ import annotations

from dataclasses import replace

from glyphs.ranges import require_positive
from whisker_array.whisker.sections import MUSIC_WIRE, Rectangle, WhiskerError
from whisker_array.whisker.shapes import LShaped

NOMINAL_FRICTION = 0.2
"""Friction for which the stage is set up; steel on clean steel has 0.1 to 0.5 (docs/pages/physics.md)."""
TIP_RADIUS_HEIGHTS = 0.012
"""Default ball radius in character heights: 0.06 mm at 5 mm, fine enough for a stroke of h/14."""
DEFAULT_K = 0.117
"""k = l2 / l1 of the strongest differentiator in the paper's experiments."""


def default_whisker(
    character_height_mm: float, *, gauge_room_mm: float = 1.5, gauge_room_heights: float = 0.3
) -> LShaped:
    """L-shaped ribbon whisker for characters of a height H that can be mounted, in proportion to H from 5 mm on.

    l1 = 6 H, k = 0.117, beta = 0; music-wire ribbon 0.06 H thick and 0.9 H wide. The width is set by the lateral
    compliance, proportional to I/I' (1 + k^3) + 3 k^2 EI/GJ: because l1 twists under the tip arm, Dyy/Dzz is at most 38
    however wide the ribbon (17 at 6 thicknesses, 31 at 15). Stress on the land is about 5 % of yield at every H; the
    natural frequency scales as 1/H, the moment as H^3. Raises WhiskerError.

    The sensor's axis is l3 = l2 - preload - room below the clamp, so that room is left between it and the land. It is
    above the clamp below H = 3 mm (l3 < 0), and F falls with it (friction 0.2, walls of 60 degrees):

    ======  =====  =====  =====  =====  =====  =========
    H, mm       1    1.5      2      3      4  5 or more
    l3 / H  -1.00  -0.50  -0.25   0.00   0.13       0.20
    falling  0.83   0.96   1.03   1.10   1.13       1.15
    rising   1.18   1.04   0.97   0.90   0.86       0.84
    ======  =====  =====  =====  =====  =====  =========

    The whisker is a profiler (F = 1) at H = 1.78 mm; for smaller characters falling walls make the moment smaller.
    """
    h = character_height_mm
    l2_mm = 6.0 * h * DEFAULT_K
    return LShaped(
        l1_mm=6.0 * h,
        l2_mm=l2_mm,
        l3_mm=l2_mm - default_preload_mm(h) - max(gauge_room_mm, gauge_room_heights * h),
        beta_rad=0.0,
        section=Rectangle(thickness_mm=0.06 * h, width_mm=0.9 * h),
        material=MUSIC_WIRE,
    )


def default_preload_mm(character_height_mm: float) -> float:
    """Preload depth d0 = 0.2 H, mm: four to six times the usual mark depth."""
    require_positive(WhiskerError, character_height_mm=character_height_mm)
    return 0.2 * character_height_mm


def profiling_whisker(character_height_mm: float) -> LShaped:
    """Default whisker with its sensor l2 / 2 above the clamp: F = 1, as for a straight whisker. Raises WhiskerError.

    With l3 = -l2 / 2 the two factors of (22) are equal for every slope and friction, so the moment is the profile (Case
    study 1), and the tip moves exactly like that of a differentiator. A straight whisker is a profiler, too, but cannot
    follow steep marks: its shaft clears a rising wall only if beta is above alpha, and a falling wall lifts it only if
    alpha + beta is below 90 degrees plus the angle of friction.
    """
    whisker = default_whisker(character_height_mm)
    return replace(whisker, l3_mm=-0.5 * whisker.l2_mm)
