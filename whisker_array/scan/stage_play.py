"""Position errors of a stage: play, errors of the screw, and the return to a line.

    command |----------------------->           towards larger coordinates the nut lags by half the play, towards
    actual  --|----------------------->         smaller ones it leads by as much; the lead-in takes up the play
               ~~~~ screw: a wave per turn, and a share of the travel ~~~~

    along(s)  = s - way play / 2 + rate s + wave sin(2 pi s / lead + phase)
    across    = line + a random offset per pass, the same for all whiskers of the comb

The defaults are those of a rolled ball screw. The limits of travel and wave are tolerance grade 5 in ISO 3408-3 (23 um
over 300 mm, 8 um from crest to trough within a turn). Play and return to a line are as stated by makers of stages
without a preloaded nut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Finite, NotNegative, Positive, Range, Validated
from whisker_array.whisker.passes import SweepPlan


@dataclass(frozen=True)
class StagePlay(Validated):
    """Position errors of a stage, the same along x and y: play, error per travel, rms error of return to a line."""

    play_mm: NotNegative = 0.010
    rate: Annotated[float, Range(-0.1, 0.1)] = 0.023 / 300.0
    wave_mm: NotNegative = 0.004
    lead_mm: Positive = 2.0
    phase_rad: Finite = 0.0
    return_mm: NotNegative = 0.002


def draw_stage_play(*, rng: np.random.Generator) -> StagePlay:
    """Draw a typical stage: the defaults, with random rate and phase of the screw."""
    rate = StagePlay.rate * float(rng.uniform(-1.0, 1.0))
    return StagePlay(rate=rate, phase_rad=float(rng.uniform(0.0, 2.0 * math.pi)))


def displace_plan(plan: SweepPlan, stage: StagePlay, *, rng: np.random.Generator) -> SweepPlan:
    """Return the plan as the stage runs it, except for the screw's wave, which varies along a line."""
    off = rng.normal(0.0, stage.return_mm, size=(plan.line_mm.shape[0], 1))
    return replace(
        plan,
        line_mm=plan.line_mm * (1.0 + stage.rate) + off,
        start_mm=plan.start_mm * (1.0 + stage.rate) - plan.direction.sign * 0.5 * stage.play_mm,
        step_mm=plan.step_mm * (1.0 + stage.rate),
    )


def apply_screw_wave(
    moment: NDArray[np.float32], flags: NDArray[np.uint8], plan: SweepPlan, stage: StagePlay
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Move samples at even positions to those of a screw's wave, a small part of a step, by linear interpolation."""
    position = plan.position_mm()
    wave_mm = stage.wave_mm * np.sin(2.0 * np.pi * position / stage.lead_mm + stage.phase_rad)
    ahead = plan.direction.sign * wave_mm / plan.step_mm
    place = np.clip(np.arange(position.size) + ahead, 0.0, position.size - 1.0)
    before = np.floor(place).astype(np.intp)
    after = np.minimum(before + 1, position.size - 1)
    part = (place - before).astype(np.float32)
    between = (np.float32(1.0) - part) * moment[..., before] + part * moment[..., after]
    return between, np.where(part > 0.0, flags[..., before] | flags[..., after], flags[..., before])
