"""The small model of speed against the whisker with mass, and its numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.proof.dynamic import groove, speed_cost, whisker_modes
from tests.proof.small_model import feet, speed_errors, true_gain
from whisker_array.simulation.at_speed import added_at_speed
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.ringing import ringing_of
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import default_touch

HEIGHT = 5.0
USUAL = default_whisker(HEIGHT)
TOUCH = default_touch(HEIGHT)


def foot(l2_mm: float) -> LShaped:
    return replace(USUAL, l2_mm=l2_mm, l3_mm=l2_mm - 2.5)


@pytest.mark.parametrize(
    "whisker",
    [USUAL, foot(9.0), straight_whisker(20.0, 0.0, Round(0.4)), straight_whisker(30.0, 0.3, USUAL.section)],
)
def test_it_rings_at_the_first_held_frequency_in_the_plane(whisker: LShaped) -> None:
    assert ringing_of(whisker).held_hz == pytest.approx(whisker_modes(whisker).held_hz[0], rel=5e-3)


@pytest.mark.parametrize("speed", [20.0, 50.0, 100.0])
@pytest.mark.parametrize("bevel_deg", [30.0, 45.0, 60.0])
def test_a_straight_whisker_rings_as_the_model_says_also_in_phase(speed: float, bevel_deg: float) -> None:
    """Its moment is the profile, so speed adds nothing but ringing. At 20 mm/s the other modes have a share."""
    whisker, bevel = straight_whisker(30.0, 0.0, USUAL.section), math.radians(bevel_deg)
    touch = TOUCH.with_whisker(whisker)
    cost = speed_cost(whisker, touch, speed_mm_s=speed, character_height_mm=HEIGHT, bevel_rad=bevel)
    fine, step_mm, _ = groove(HEIGHT, tip_radius_mm=touch.tip_radius_mm, bevel_rad=bevel)
    (added,) = added_at_speed(fine, touch, sample_rate_hz=speed / step_mm) / touch.land_moment_n_mm()
    true = cost.fast - cost.slow
    assert np.corrcoef(true, added)[0, 1] > 0.85
    assert 0.95 < math.sqrt(float((true**2).mean() / (added**2).mean())) < (1.35 if speed < 50.0 else 1.1)


@pytest.mark.parametrize("speed", [35.0, 50.0, 70.0, 100.0, 140.0])
def test_the_usual_whisker_errs_as_much_as_with_mass_within_a_factor_of_two(speed: float) -> None:
    errors = speed_errors(USUAL, TOUCH, speed_mm_s=speed, height_mm=HEIGHT)
    assert 0.5 < errors.model / errors.with_mass < 2.0, errors


@pytest.mark.parametrize("l2_mm", [1.0, 2.5, 3.51])
def test_over_all_speeds_the_errors_are_equal_on_average(l2_mm: float) -> None:
    touch = TOUCH.with_whisker(foot(l2_mm))
    ratios = []
    for speed in (35.0, 50.0, 70.0, 100.0, 140.0):
        errors = speed_errors(foot(l2_mm), touch, speed_mm_s=speed, height_mm=HEIGHT)
        ratios.append(math.log(errors.model / errors.with_mass))
    assert math.exp(float(np.mean(ratios))) == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("name", ["straight", "l2 = 2.5 mm", "l2 = 6 mm"])
def test_the_gain_is_that_of_whiskers_with_mass(name: str) -> None:
    whisker = feet()[name]
    assert ringing_of(whisker).gain == pytest.approx(true_gain(whisker), rel=0.15)


def test_the_error_is_that_of_the_same_speed_for_every_height() -> None:
    """Everything scales with the character, so one speed holds for all."""
    small, large = (
        speed_errors(default_whisker(h), default_touch(h), speed_mm_s=50.0, height_mm=h).model
        for h in (5.0, 10.0)
    )
    assert small == pytest.approx(large, rel=0.02)
