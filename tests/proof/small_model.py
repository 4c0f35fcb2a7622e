"""The small model of what speed adds (`added_at_speed`) beside the whisker with mass, over grooves of several widths.

A single groove has nulls and peaks, where the ringing of its edges cancels or adds up. The model, which rings at one
frequency on land and walls, has them elsewhere. So errors are root mean squares over the usual widths of strokes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.proof.dynamic import BEVEL_RAD, groove, speed_cost
from whisker_array.simulation.at_speed import added_at_speed
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.touch import Touch

STROKES_HEIGHTS = (0.06, 0.075, 0.09, 0.105, 0.12, 0.14)


@dataclass(frozen=True)
class SpeedErrors:
    """Errors of the edge map, shares of its signal: of the whisker with mass, and of the model."""

    with_mass: float
    model: float


def speed_errors(
    whisker: Whisker, touch: Touch, *, speed_mm_s: float, height_mm: float, bevel_rad: float = BEVEL_RAD
) -> SpeedErrors:
    """Compute both errors; the model is felt at the usual samples, at every phase of these to the edges."""
    errors = np.zeros(3)
    for stroke in STROKES_HEIGHTS:
        cost = speed_cost(
            whisker, touch, speed_mm_s=speed_mm_s, character_height_mm=height_mm, bevel_rad=bevel_rad,
            stroke_heights=stroke,
        )  # fmt: skip
        fine, step_mm, _ = groove(
            height_mm, tip_radius_mm=touch.tip_radius_mm, bevel_rad=bevel_rad, stroke_heights=stroke
        )
        a_pixel = round(height_mm / LINES_PER_HEIGHT / step_mm)
        a_sample = a_pixel // SAMPLES_PER_LINE_PITCH
        added = [
            added_at_speed(fine[:, phase::a_sample], touch, sample_rate_hz=speed_mm_s / (a_sample * step_mm))[
                0
            ]
            / touch.land_moment_n_mm()
            for phase in range(a_sample)
        ]
        model = float(np.mean([_mean_square(line, SAMPLES_PER_LINE_PITCH) for line in added]))
        errors += (
            _mean_square(cost.fast - cost.slow, a_pixel),
            model,
            _mean_square(cost.slow - 1.0, a_pixel),
        )
    return SpeedErrors(math.sqrt(errors[0] / errors[2]), math.sqrt(errors[1] / errors[2]))


def _mean_square(line: NDArray[np.floating], pixel: int) -> float:
    return float((np.convolve(line, np.full(pixel, 1.0 / pixel), mode="valid") ** 2).mean())
