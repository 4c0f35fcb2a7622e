"""Errors by speed: the dynamic whisker over a stamped groove, against the same one on a slow stage.

    land ______          ______ ... ringing is looked at from here on, a stroke behind the last edge
               \\        /
                \\______/   bevels of 45 degrees, depth h/25, floor h/10 wide; dilated by the ball

Error is what an edge map would have: both moments averaged over pixels of a line pitch, the difference's root mean
square over that of the signal. Everything scales with the character height, so that one speed holds for whiskers in
proportion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import require_positive
from glyphs.surface.maps import HeightMap
from whisker_array.simulation.dynamic import trace_dynamic
from whisker_array.simulation.dynamic_modes import WhiskerModes, contact_mm_per_n, whisker_modes
from whisker_array.simulation.surface import prepare_surface
from whisker_array.simulation.traces import SampleFlag, Traces
from whisker_array.whisker.array import LINES_PER_HEIGHT
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.touch import Touch
from whisker_array.whisker.validity import land_force_n

BEVEL_RAD = math.pi / 4.0
"""The usual bevel of stamped marks."""
DEPTH_HEIGHTS, STROKE_HEIGHTS = 0.04, 0.1
"""Dimensions of usual marks, character heights (0.25 mm deep at 6.35 mm)."""
FINE_ERROR, COARSE_ERROR = 0.05, 0.2
"""Allowed errors of passes that characters are read from, and of those that only look for a line."""
_STEPS_A_PITCH, _BEFORE_HEIGHTS, _BEHIND_HEIGHTS = 20, 0.3, 0.8
_SLOWEST, _FIRST, _FASTEST, _HALVINGS = 2.0, 10.0, 2000.0, 9


@dataclass(frozen=True)
class SpeedCost:
    """Errors at one speed.

    Attributes:
        speed_mm_s: of the stage.
        error: of the edge map, as a share of the signal.
        ringing: greatest error a stroke behind the last edge and further, land moments.
        in_air_mm: length of surface that was not touched all the while.
    """

    speed_mm_s: float
    error: float
    ringing: float
    in_air_mm: float


@dataclass(frozen=True, eq=False)
class _Trial:
    """One whisker over one groove, made ready."""

    touch: Touch
    modes: WhiskerModes
    contact: float
    heights: NDArray[np.float32]
    step_mm: float
    rings_from: int

    def traced(self, speed_mm_s: float) -> Traces:
        """The groove at a speed."""
        return trace_dynamic(
            self.heights,
            self.modes,
            step_mm=self.step_mm,
            speed_mm_s=speed_mm_s,
            preload_mm=self.touch.preload_mm,
            friction=self.touch.friction,
            contact_mm_per_n=self.contact,
        )


def _groove(
    height_mm: float, *, tip_radius_mm: float, bevel_rad: float
) -> tuple[NDArray[np.float32], float, int]:
    """Heights of the dilated groove, their distance, and where ringing begins."""
    step = height_mm / (LINES_PER_HEIGHT * _STEPS_A_PITCH)
    depth, stroke = DEPTH_HEIGHTS * height_mm, STROKE_HEIGHTS * height_mm
    wide = stroke + 2.0 * depth / math.tan(bevel_rad)
    x = np.arange(0.0, (_BEFORE_HEIGHTS + _BEHIND_HEIGHTS) * height_mm + wide, step)
    middle = _BEFORE_HEIGHTS * height_mm + 0.5 * wide
    z = -np.clip((0.5 * wide - np.abs(x - middle)) * math.tan(bevel_rad), 0.0, depth)
    rim = math.ceil(tip_radius_mm / step) + 1
    rows = np.tile(z.astype(np.float32), (2 * rim + 1, 1))
    felt = prepare_surface(HeightMap(rows, step), tip_radius_mm=tip_radius_mm, friction=0.0)
    return felt.fields[rim : rim + 1, :, 0], step, round((middle + 0.5 * wide + stroke) / step)


@lru_cache(maxsize=8)
def _trial(whisker: Whisker, touch: Touch, character_height_mm: float, bevel_rad: float) -> _Trial:
    force = float(land_force_n(whisker, preload_mm=touch.preload_mm, mu=touch.friction)[1])
    heights, step, rings = _groove(
        character_height_mm, tip_radius_mm=touch.tip_radius_mm, bevel_rad=bevel_rad
    )
    contact = contact_mm_per_n(tip_radius_mm=touch.tip_radius_mm, force_n=force, material=whisker.material)
    return _Trial(touch, whisker_modes(whisker), contact, heights, step, rings)


@lru_cache(maxsize=8)
def _slow_moment(trial: _Trial) -> NDArray[np.float64]:
    """Moment on a stage so slow that nothing rings. (The pointwise one has no slip of the tip at the groove's foot.)"""
    return np.asarray(trial.traced(_SLOWEST).moment_n_mm[0], dtype=np.float64)


def speed_cost(
    whisker: Whisker,
    touch: Touch,
    *,
    speed_mm_s: float,
    character_height_mm: float,
    bevel_rad: float = BEVEL_RAD,
) -> SpeedCost:
    """Simulate the errors of a speed over one stamped groove.

    Args:
        whisker: of the touch.
        touch: preload, ball and friction.
        speed_mm_s: of the stage.
        character_height_mm: that the groove is in proportion to.
        bevel_rad: of its walls.

    Raises:
        WhiskerError: a speed or height that is not positive, or a touch without a ball.
    """
    require_positive(WhiskerError, character_height_mm=character_height_mm, speed_mm_s=speed_mm_s)
    trial = _trial(whisker, touch, character_height_mm, bevel_rad)
    slow, fast = _slow_moment(trial), trial.traced(speed_mm_s)
    land = float(slow[0])
    signal, wrong = slow / land - 1.0, (fast.moment_n_mm[0].astype(np.float64) - slow) / land
    pixel = np.ones(_STEPS_A_PITCH) / _STEPS_A_PITCH
    averaged = [np.convolve(v, pixel, mode="valid") for v in (wrong, signal)]
    lost = (fast.flags[0] & np.uint8(SampleFlag.CONTACT_LOST)) != 0
    return SpeedCost(
        speed_mm_s=speed_mm_s,
        error=float(np.sqrt((averaged[0] ** 2).mean() / (averaged[1] ** 2).mean())),
        ringing=float(np.abs(wrong[trial.rings_from :]).max()),
        in_air_mm=float(lost.sum()) * trial.step_mm,
    )


def groove_traces(
    whisker: Whisker,
    touch: Touch,
    *,
    speed_mm_s: float,
    character_height_mm: float,
    bevel_rad: float = BEVEL_RAD,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Places mm, and moments over the land's, of a slow and of a fast stage over the groove of `speed_cost`.

    Raises:
        WhiskerError: as `speed_cost`.
    """
    require_positive(WhiskerError, character_height_mm=character_height_mm, speed_mm_s=speed_mm_s)
    trial = _trial(whisker, touch, character_height_mm, bevel_rad)
    slow, fast = _slow_moment(trial), trial.traced(speed_mm_s).moment_n_mm[0].astype(np.float64)
    places = trial.step_mm * np.arange(slow.size, dtype=np.float64)
    return places, slow / float(slow[0]), fast / float(slow[0])


def fastest_mm_s(
    whisker: Whisker,
    touch: Touch,
    *,
    character_height_mm: float,
    allowed_error: float = FINE_ERROR,
    bevel_rad: float = BEVEL_RAD,
) -> float:
    """Find the fastest stage whose edge map is within the allowed error.

    Args:
        whisker: of the touch.
        touch: preload, ball and friction.
        character_height_mm: of the marks.
        allowed_error: share of the signal, see `SpeedCost.error`.
        bevel_rad: of the walls.

    Raises:
        WhiskerError: an error that is not positive.
    """
    require_positive(WhiskerError, allowed_error=allowed_error)

    def kept(speed: float) -> bool:
        cost = speed_cost(
            whisker, touch, speed_mm_s=speed, character_height_mm=character_height_mm, bevel_rad=bevel_rad
        )
        return cost.error <= allowed_error

    # upwards from slow: beyond the first limit half a swing may hide the error by chance
    slow, fast = _SLOWEST, _FIRST
    while kept(fast):
        slow, fast = fast, 1.25 * fast
        if fast > _FASTEST:
            return slow
    for _ in range(_HALVINGS):
        middle = math.sqrt(slow * fast)
        slow, fast = (middle, fast) if kept(middle) else (slow, middle)
    return slow
