"""The small model of what speed adds (`added_at_speed`) beside the whisker with mass, over grooves of several widths.

A single groove has nulls and peaks, where the ringing of its edges cancels or adds up. The model, which rings at one
frequency on land and walls, has them elsewhere. So errors are root mean squares over the usual widths of strokes.

`python -m tests.proof.small_model` prints the gains to which `whisker_array.whisker.ringing` was fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.proof.dynamic import BEVEL_RAD, groove, speed_cost
from whisker_array.simulation.at_speed import added_at_speed
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.ringing import ringing_of
from whisker_array.whisker.shapes import LShaped, Whisker, straight_whisker
from whisker_array.whisker.touch import Touch, default_touch

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


def true_gain(
    whisker: Whisker,
    *,
    height_mm: float = 5.0,
    speeds_mm_s: Sequence[float] = (20.0, 35.0, 50.0, 70.0, 100.0, 140.0),
    bevels_deg: Sequence[float] = (30.0, 45.0, 60.0),
    strokes_heights: Sequence[float] = (0.06, 0.09, 0.12),
) -> float:
    """Gain with which the model rings as much as a whisker with mass: mean over speeds and bevels, of logarithms."""
    touch, ratios = default_touch(height_mm).with_whisker(whisker), []
    assert touch.ringing is not None
    alone = replace(touch, ringing=replace(touch.ringing, gain=1.0))
    for bevel in bevels_deg:
        for speed in speeds_mm_s:
            squares = np.zeros(2)
            for stroke in strokes_heights:
                shape = {"bevel_rad": math.radians(bevel), "stroke_heights": stroke}
                cost = speed_cost(whisker, touch, speed_mm_s=speed, character_height_mm=height_mm, **shape)
                fine, step_mm, _ = groove(height_mm, tip_radius_mm=touch.tip_radius_mm, **shape)
                added = added_at_speed(fine, alone, sample_rate_hz=speed / step_mm) / touch.land_moment_n_mm()
                squares += float(((cost.fast - cost.slow) ** 2).mean()), float((added**2).mean())
            ratios.append(0.5 * math.log(squares[0] / squares[1]))
    return math.exp(float(np.mean(ratios)))


def feet(height_mm: float = 5.0) -> dict[str, LShaped]:
    """Whiskers of the default's beam, from none to a long foot, their sensors as high above the land."""
    usual = default_whisker(height_mm)
    lengths_mm = (1.0, 2.5, usual.l2_mm, 4.5, 6.0)
    straight = {"straight": straight_whisker(usual.l1_mm, 0.0, usual.section)}
    return straight | {
        f"l2 = {l2_mm:g} mm": replace(usual, l2_mm=l2_mm, l3_mm=l2_mm - 2.5) for l2_mm in lengths_mm
    }


def _mean_square(line: NDArray[np.floating], pixel: int) -> float:
    return float((np.convolve(line, np.full(pixel, 1.0 / pixel), mode="valid") ** 2).mean())


if __name__ == "__main__":
    for name, whisker in feet().items():
        print(
            f"{name}: k {whisker.k:.3f}, gain {true_gain(whisker):.1f}, by the fit {ringing_of(whisker).gain:.1f}"
        )
