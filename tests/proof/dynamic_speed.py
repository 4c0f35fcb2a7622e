"""Errors by speed: a dynamic whisker over a stamped groove, compared with the same whisker on a slow stage.

    land ______          ______ ... ringing is measured from here, a stroke behind the last edge
               \\        /
                \\______/   bevels of 45 degrees, depth h/25, floor h/10 wide; dilated by the ball

The error is that of an edge map: both moments are averaged over pixels of a line pitch, and the rms of the difference
is divided by that of the signal. Everything scales with the character height, so that one speed holds for all
whiskers in proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import require_positive
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap
from tests.proof.dynamic import trace_dynamic
from tests.proof.dynamic_modes import contact_mm_per_n, whisker_modes
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
"""Depth and stroke of usual marks, character heights (0.25 mm deep at 6.35 mm)."""
FINE_ERROR = 0.05
"""Largest error of the edge map in passes for reading characters."""
_STEPS_A_PITCH, _BEFORE_HEIGHTS, _BEHIND_HEIGHTS = 20, 0.3, 0.8
_SLOWEST, _FIRST, _FASTEST, _HALVINGS = 2.0, 10.0, 2000.0, 9


@dataclass(frozen=True, eq=False, repr=False)
class SpeedCost(OneLine):
    """One speed over the groove: moments, as shares of the land moment, and errors.

    Attributes:
        speed_mm_s: speed of the stage.
        place_mm: (samples,) position along the trace.
        fast: (samples,) moment at that speed.
        slow: (samples,) moment on a stage so slow that nothing rings. (The pointwise fidelity would leave out the slip
            of the tip at the foot of the groove.)
        error: error of the edge map, as a share of the signal.
        ringing: greatest error from a stroke behind the last edge on.
        in_air_mm: length of surface on which the tip was in the air at least briefly.
    """

    speed_mm_s: float
    place_mm: NDArray[np.float64]
    fast: NDArray[np.float64]
    slow: NDArray[np.float64]
    error: float
    ringing: float
    in_air_mm: float


@dataclass(frozen=True, eq=False)
class _Stage:
    """One whisker over one groove: its traces by speed, the moment at the slowest, and the start of the ringing."""

    trace: Callable[..., Traces]
    slow_n_mm: NDArray[np.float64]
    step_mm: float
    rings_from: int


def _groove(
    height_mm: float, *, tip_radius_mm: float, bevel_rad: float
) -> tuple[NDArray[np.float32], float, int]:
    """Heights of the dilated groove, their pitch, and the sample from which ringing is measured."""
    step = height_mm / (LINES_PER_HEIGHT * _STEPS_A_PITCH)
    depth, stroke = DEPTH_HEIGHTS * height_mm, STROKE_HEIGHTS * height_mm
    wide = stroke + 2.0 * depth / math.tan(bevel_rad)
    x = np.arange(0.0, (_BEFORE_HEIGHTS + _BEHIND_HEIGHTS) * height_mm + wide, step)
    middle = _BEFORE_HEIGHTS * height_mm + 0.5 * wide
    z = -np.clip((0.5 * wide - np.abs(x - middle)) * math.tan(bevel_rad), 0.0, depth)
    rim = math.ceil(tip_radius_mm / step) + 1
    rows = np.tile(z.astype(np.float32), (2 * rim + 1, 1))
    dilated = prepare_surface(HeightMap(rows, step), tip_radius_mm=tip_radius_mm, friction=0.0)
    return dilated.fields[rim : rim + 1, :, 0], step, round((middle + 0.5 * wide + stroke) / step)


@lru_cache(maxsize=8)
def _stage(whisker: Whisker, touch: Touch, character_height_mm: float, bevel_rad: float) -> _Stage:
    ball, preload = touch.tip_radius_mm, touch.preload_mm
    force = float(land_force_n(whisker, preload_mm=preload, mu=touch.friction)[1])
    heights, step, rings_from = _groove(character_height_mm, tip_radius_mm=ball, bevel_rad=bevel_rad)
    trace = partial(
        trace_dynamic, heights, whisker_modes(whisker), step_mm=step, preload_mm=preload, friction=touch.friction,
        contact_mm_per_n=contact_mm_per_n(tip_radius_mm=ball, force_n=force, material=whisker.material),
    )  # fmt: skip
    return _Stage(trace, trace(speed_mm_s=_SLOWEST).moment_n_mm[0].astype(np.float64), step, rings_from)


def speed_cost(
    whisker: Whisker,
    touch: Touch,
    *,
    speed_mm_s: float,
    character_height_mm: float,
    bevel_rad: float = BEVEL_RAD,
) -> SpeedCost:
    """Simulate the errors at a speed over one stamped groove.

    Args:
        whisker: whisker of the touch.
        touch: preload, ball and friction.
        speed_mm_s: speed of the stage.
        character_height_mm: character height, with which the groove scales.
        bevel_rad: bevel of its walls.

    Raises:
        WhiskerError: the speed or height is not positive, or the touch has no ball.
    """
    require_positive(WhiskerError, character_height_mm=character_height_mm, speed_mm_s=speed_mm_s)
    stage = _stage(whisker, touch, character_height_mm, bevel_rad)
    slow, traced = stage.slow_n_mm, stage.trace(speed_mm_s=speed_mm_s)
    fast, land = traced.moment_n_mm[0].astype(np.float64), float(slow[0])
    signal, wrong = slow / land - 1.0, (fast - slow) / land
    pixel = np.ones(_STEPS_A_PITCH) / _STEPS_A_PITCH
    averaged = [np.convolve(v, pixel, mode="valid") for v in (wrong, signal)]
    lost = (traced.flags[0] & np.uint8(SampleFlag.CONTACT_LOST)) != 0
    return SpeedCost(
        speed_mm_s=speed_mm_s,
        place_mm=stage.step_mm * np.arange(slow.size, dtype=np.float64),
        fast=fast / land,
        slow=slow / land,
        error=float(np.sqrt((averaged[0] ** 2).mean() / (averaged[1] ** 2).mean())),
        ringing=float(np.abs(wrong[stage.rings_from :]).max()),
        in_air_mm=float(lost.sum()) * stage.step_mm,
    )


def fastest_mm_s(
    whisker: Whisker,
    touch: Touch,
    *,
    character_height_mm: float,
    allowed_error: float = FINE_ERROR,
    bevel_rad: float = BEVEL_RAD,
) -> float:
    """Find the fastest speed at which the edge map is within the allowed error.

    Args:
        whisker: whisker of the touch.
        touch: preload, ball and friction.
        character_height_mm: character height of the marks.
        allowed_error: share of the signal, see `SpeedCost.error`.
        bevel_rad: bevel of the walls.

    Raises:
        WhiskerError: the allowed error is not positive.
    """
    require_positive(WhiskerError, allowed_error=allowed_error)

    cost = partial(speed_cost, whisker, touch, character_height_mm=character_height_mm, bevel_rad=bevel_rad)

    def is_allowed(speed: float) -> bool:
        return cost(speed_mm_s=speed).error <= allowed_error

    # search upwards: beyond the first limit the ringing may cancel by chance
    slow, fast = _SLOWEST, _FIRST
    while is_allowed(fast):
        slow, fast = fast, 1.25 * fast
        if fast > _FASTEST:
            return slow
    for _ in range(_HALVINGS):
        middle = math.sqrt(slow * fast)
        slow, fast = (middle, fast) if is_allowed(middle) else (slow, middle)
    return slow
