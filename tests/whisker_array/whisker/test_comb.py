"""Room in a comb: bodies that touch are refused, with what would do; staggers are as small as geometry allows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from whisker_array.whisker.array import COMB_STEP_HEIGHTS, RasterPlan, WhiskerArray, default_comb
from whisker_array.whisker.comb import (
    GAP_MM,
    Body,
    body_of,
    collisions,
    default_body,
    least_rows,
    least_stagger_mm,
)
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.sections import WhiskerError

HEIGHT = 5.0
BODY = default_body(HEIGHT)
TWO_ROWS = WhiskerArray(8, 2.5, rows=2)


def inclined(beta_deg: float) -> Body:
    whisker = replace(default_whisker(HEIGHT), beta_rad=math.radians(beta_deg))
    return body_of(whisker, preload_mm=default_preload_mm(HEIGHT))


def test_the_default_body_is_the_default_whisker_bent_by_its_preload() -> None:
    """In proportion to the height: the unit body scaled is the body of that height, the elastica's 1e-7 apart."""
    own = body_of(default_whisker(HEIGHT), preload_mm=default_preload_mm(HEIGHT))
    assert BODY.width_mm == pytest.approx(4.5)
    assert (own.reach_mm, own.aside_mm, own.mass_g) == pytest.approx(
        (BODY.reach_mm, BODY.aside_mm, BODY.mass_g)
    )
    rest, bent = BODY.shapes_mm
    # whoever changes the default whisker writes `DEFAULT_BENT` anew
    assert own.shapes_mm[1] == pytest.approx(bent, abs=1e-6 * HEIGHT)
    assert bent[-1, 1] - rest[-1, 1] == pytest.approx(1.1 * default_preload_mm(HEIGHT), rel=1e-6)
    # steel: ribbon 0.3 x 4.5 x (30 + 3.51) mm and a clamp of 2.4 x 2.4 x 4.5 mm
    assert BODY.mass_g == pytest.approx(7.8e-3 * (0.3 * 4.5 * 33.51 + 2.4 * 2.4 * 4.5), rel=0.02)


def test_ribbons_on_half_a_height_cannot_stand_side_by_side() -> None:
    with pytest.raises(
        WhiskerError, match=r"4\.5 mm wide cannot stand 2\.5 mm apart.*2 rows 3\d.* mm behind"
    ):
        WhiskerArray(8, 2.5, body=BODY)
    with pytest.raises(WhiskerError, match="of air between a bent whisker and one that is not"):
        WhiskerArray(8, 2.5, rows=2, stagger_mm=10.0, body=BODY)
    with pytest.raises(WhiskerError, match=r"a pitch of 4\.76 mm or more"):
        WhiskerArray(8, 4.7, body=BODY)
    WhiskerArray(8, 4.77, body=BODY)
    WhiskerArray(8, 2.5, rows=2, stagger_mm=33.0, body=BODY)
    WhiskerArray(8, 2.5)  # points, as in a prediction


@pytest.mark.parametrize("beta_deg", [10.0, 20.0])
def test_inclined_whiskers_lie_like_tiles(beta_deg: float) -> None:
    """Parallel l1 are stagger x sin(beta) apart: no less than thickness and air, no more than the clamp needs, too."""
    body = inclined(beta_deg)
    stagger = least_stagger_mm(body, TWO_ROWS, step_mm=0.05)
    lift = 1.1 * default_preload_mm(HEIGHT)
    apart, slope = stagger * math.sin(math.radians(beta_deg)), math.sin(math.radians(beta_deg))
    least = body.thickness_mm + GAP_MM
    assert least < apart < least + lift + body.clamp_mm[1] + slope * body.clamp_mm[0]
    assert stagger < 0.5 * least_stagger_mm(BODY, TWO_ROWS, step_mm=0.5)
    assert not collisions(body, replace(TWO_ROWS, stagger_mm=stagger))
    assert collisions(body, replace(TWO_ROWS, stagger_mm=stagger - 0.05))


def test_level_whiskers_stand_in_file() -> None:
    stagger = least_stagger_mm(BODY, TWO_ROWS, step_mm=0.25)
    # clamp, l1 and how far the tip is pushed back; the tip arm is half a thickness thicker
    assert BODY.reach_mm < stagger <= BODY.full_stagger_mm + 0.25
    assert BODY.clear_mm(stagger) >= GAP_MM


def test_clearance_is_that_of_parallel_plates() -> None:
    """Straight bodies without a bend: the air is the distance of two parallel lines less the thickness."""
    beta = math.radians(30.0)
    line = np.array([[0.0, 0.0], [-20.0 * math.cos(beta), -20.0 * math.sin(beta)]])
    body = Body(2.0, 0.2, 0.0, (line,), (0.01, 0.01), 1.0)
    for behind in (1.0, 2.0, 5.0):
        # points of the line lie a thickness apart, corners of the small clamp within 0.01 mm
        assert body.clear_mm(behind) == pytest.approx(behind * math.sin(beta) - 0.2, abs=0.12)


@pytest.mark.parametrize("height", [1.0, 3.5, 12.7])
@pytest.mark.parametrize("kinds", [1, 2])
def test_the_default_comb_can_be_built_at_any_height(height: float, kinds: int) -> None:
    array = default_comb(height, n_whiskers=8, kinds=kinds)
    assert array.rows == 1 == least_rows(default_body(height), pitch_mm=array.pitch_mm, n_whiskers=8)
    steps = array.stagger_mm / (COMB_STEP_HEIGHTS * height)
    assert steps == pytest.approx(round(steps), abs=1e-9)
    assert len(array.offset_mm) == 8 * kinds
    assert array.mass_g == pytest.approx(8 * kinds * default_body(height).mass_g)


def test_a_stagger_between_samples_is_refused() -> None:
    comb = WhiskerArray(8, 2.5, rows=2, stagger_mm=33.05, body=BODY)
    region = (0.0, 0.0, 30.0, 10.0)
    with pytest.raises(WhiskerError, match="must divide the stagger"):
        RasterPlan(comb, region, line_pitch_mm=0.25, sample_pitch_mm=0.125)
    RasterPlan(replace(comb, stagger_mm=33.0), region, line_pitch_mm=0.25, sample_pitch_mm=0.125)
    with pytest.raises(WhiskerError, match="rows is 3"):
        WhiskerArray(2, 5.0, rows=3)
    with pytest.raises(WhiskerError, match="stagger_mm is -1"):
        WhiskerArray(2, 5.0, stagger_mm=-1.0)
