"""The raster plan: every line once, at its place, in the time that it states; its passes, and room in a comb."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.surface.maps import TraceDirection
from whisker_array.whisker.array import (
    ALL_DIRECTIONS,
    COMB_STEP_HEIGHTS,
    LINES_PER_HEIGHT,
    SAFE_SPEED_MM_S,
    RasterPlan,
    default_comb,
    default_plan,
)
from whisker_array.whisker.comb import (
    GAP_MM,
    Body,
    WhiskerArray,
    body_of,
    collisions,
    default_body,
    least_rows,
    least_stagger_mm,
)
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.passes import RAPID_MM_S, Pass
from whisker_array.whisker.sections import Round, WhiskerError
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.validity import QUASI_STATIC_SHARE, first_bending_frequency_hz

# ------------------------------------------------------------------------------------------------------------- array

plans = st.builds(
    lambda whiskers, lines, pitch, x0, y0, width, height, step, lead: RasterPlan(
        array=WhiskerArray(whiskers, lines * pitch),
        region_mm=(x0, y0, x0 + width, y0 + height),
        line_pitch_mm=pitch,
        sample_pitch_mm=step,
        lead_mm=lead,
    ),
    whiskers=st.integers(1, 9),
    lines=st.integers(1, 12),
    pitch=st.floats(0.05, 0.7),
    x0=st.floats(-5.0, 5.0),
    y0=st.floats(-5.0, 5.0),
    width=st.floats(0.5, 12.0),
    height=st.floats(0.5, 12.0),
    step=st.floats(0.03, 0.4),
    lead=st.floats(0.0, 2.0),
)


@settings(max_examples=25, deadline=None)
@given(plan=plans)
def test_every_line_is_traced_once_at_its_place(plan: RasterPlan) -> None:
    x0, y0, x1, y1 = plan.region_mm
    for sweep in plan.sweeps():
        low, high = (y0, y1) if sweep.direction.along_x else (x0, x1)
        place = np.sort(sweep.line_mm.ravel())
        np.testing.assert_allclose(place, low + plan.line_pitch_mm * np.arange(place.size), atol=1e-9)
        # up to the far side of the region, and no block more than needed
        assert place[-1] > high - plan.line_pitch_mm - 1e-9
        block = plan.array.n_whiskers * plan.interlace
        assert place.size % block == 0
        assert place[-block] <= high + 1e-5


@settings(max_examples=20, deadline=None)
@given(plan=plans)
def test_over_a_piece_every_whisker_crosses_the_whole_region(plan: RasterPlan) -> None:
    x0, y0, x1, y1 = plan.region_mm
    for sweep in replace(plan, each_whisker=True).sweeps():
        low, high = (y0, y1) if sweep.direction.along_x else (x0, x1)
        np.testing.assert_allclose(np.diff(sweep.line_mm, axis=0), plan.line_pitch_mm, atol=1e-9)
        np.testing.assert_allclose(np.diff(sweep.line_mm, axis=1), plan.array.pitch_mm, atol=1e-9)
        assert (sweep.line_mm.min(axis=0) <= low + 1e-9).all()
        assert (sweep.line_mm.max(axis=0) > high - plan.line_pitch_mm - 1e-9).all()


@settings(max_examples=25, deadline=None)
@given(plan=plans)
def test_samples_cover_the_region_both_ways(plan: RasterPlan) -> None:
    x0, y0, x1, y1 = plan.region_mm
    step = plan.sample_pitch_mm
    sweeps = {sweep.direction: sweep for sweep in plan.sweeps()}
    for direction, sweep in sweeps.items():
        low, high = (x0, x1) if direction.along_x else (y0, y1)
        at = sweep.position_mm()
        assert at.size == sweep.n_samples
        np.testing.assert_allclose(np.diff(at), -step if direction.backward else step, rtol=1e-6)
        core = np.sort(at[sweep.n_lead : at.size - sweep.n_lead])
        assert core[0] == pytest.approx(low, abs=1e-9)
        assert high - step - 1e-9 < core[-1] < high + 1e-5
        assert abs(sweep.n_lead * step - plan.lead_mm) <= 0.5 * step + 1e-9
    # there and back, the whisker passes the same places
    for there, back in (
        (TraceDirection.FORWARD_X, TraceDirection.BACK_X),
        (TraceDirection.FORWARD_Y, TraceDirection.BACK_Y),
    ):
        np.testing.assert_allclose(sweeps[there].position_mm(), sweeps[back].position_mm()[::-1], atol=1e-9)


@pytest.mark.parametrize("height", [1.0, 2.5, 5.0, 12.7])
def test_the_default_plan_follows_the_character_height(height: float) -> None:
    plan = default_plan((0.0, 0.0, 8.0 * height, 2.0 * height), character_height_mm=height)
    assert plan.line_pitch_mm == pytest.approx(height / LINES_PER_HEIGHT)
    assert plan.directions == ALL_DIRECTIONS
    assert plan.interlace == LINES_PER_HEIGHT * (1.5 if height < 1.9 else 1)  # ribbons need air beside them
    other = default_plan((0.0, 0.0, 80.0, 20.0), character_height_mm=10.0)
    if height >= 1.9:
        assert plan.n_samples == pytest.approx(other.n_samples, rel=0.02)  # the same picture at every scale
    assert default_plan((0, 0, 1, 1), character_height_mm=1.0, speed_mm_s=7.0).sample_rate_hz == 7.0 * 80


@settings(max_examples=40, deadline=None)
@given(plan=plans, rows=st.integers(2, 4), samples=st.integers(1, 90))
def test_a_stagger_costs_its_way_at_tracing_speed_and_back(plan: RasterPlan, rows: int, samples: int) -> None:
    array = plan.array
    stagger = samples * plan.sample_pitch_mm
    staggered = replace(plan, array=replace(array, rows=min(rows, array.n_whiskers), stagger_mm=stagger))
    far = stagger * (min(rows, array.n_whiskers) - 1)
    more = plan.n_passes * (far / plan.speed_mm_s + far / RAPID_MM_S)
    assert staggered.scan_time_s == pytest.approx(plan.scan_time_s + more, rel=1e-9)
    assert staggered.n_samples == plan.n_samples  # each row keeps the samples of its own stretch
    for one, other in zip(plan.sweeps(), staggered.sweeps(), strict=True):
        np.testing.assert_array_equal(one.line_mm, other.line_mm)
        assert other.behind.max() == (min(rows, array.n_whiskers) - 1) * samples


def test_refusals_say_what_is_wrong() -> None:
    good = {
        "array": WhiskerArray(3, 1.0),
        "region_mm": (0.0, 0.0, 5.0, 5.0),
        "line_pitch_mm": 0.25,
        "sample_pitch_mm": 0.1,
    }
    cases = [
        ({"line_pitch_mm": 0.0}, "line_pitch_mm"),
        ({"sample_pitch_mm": math.nan}, "sample_pitch_mm"),
        ({"speed_mm_s": -1.0}, "speed_mm_s"),
        ({"lead_mm": -0.1}, "lead_mm is -0.1"),
        ({"region_mm": (0.0, 0.0, 0.0, 5.0)}, "empty"),
        ({"region_mm": (0.0, 0.0, math.inf, 5.0)}, "must be finite"),
        ({"directions": ()}, "at least one"),
        ({"directions": (TraceDirection.BACK_X,) * 2}, "at most once"),
        ({"line_pitch_mm": 0.3}, "divide the whisker pitch, as 0.25 does"),
        ({"line_pitch_mm": 1.5}, "divide the whisker pitch, as 1 does"),
    ]
    assert RasterPlan(**good).interlace == 4
    for change, message in cases:
        with pytest.raises(WhiskerError, match=message):
            RasterPlan(**{**good, **change})
    # one whisker has no neighbour to be apart from
    assert RasterPlan(**{**good, "array": WhiskerArray(1, 1.0), "line_pitch_mm": 0.3}).n_passes > 0
    with pytest.raises(WhiskerError, match="n_whiskers is 0"):
        WhiskerArray(0, 1.0)
    with pytest.raises(WhiskerError, match="pitch_mm"):
        WhiskerArray(2, 0.0)
    with pytest.raises(WhiskerError, match="character_height_mm"):
        default_plan((0, 0, 1, 1), character_height_mm=-5.0)


# ------------------------------------------------------------------------------------------------------------ passes

ONE = Pass(
    direction=TraceDirection.FORWARD_X,
    line_mm=(1.0, 3.0),
    along_mm=(2.0, 12.0),
    sample_pitch_mm=0.05,
    speed_mm_s=50.0,
    lead_mm=1.0,
    air_samples=20,
    turnaround_s=0.25,
)


def test_what_a_pass_costs() -> None:
    # 10 mm felt and 1 mm before and behind are 241 samples, 20 more in the air: 261 at 1000 a second
    assert ONE.n_samples == 241
    assert ONE.stage_s == pytest.approx(0.261 + 0.25)
    assert replace(ONE, speed_mm_s=25.0).stage_s == pytest.approx(0.522 + 0.25)


@pytest.mark.parametrize("two_way", [False, True])
@pytest.mark.parametrize("kinds", [1, 2])
def test_a_raster_is_its_passes(two_way: bool, kinds: int) -> None:
    plan = default_plan((0.0, 0.0, 30.0, 12.0), character_height_mm=5.0, two_way=two_way, kinds=kinds)
    passes = plan.passes()
    assert len(passes) == plan.n_passes
    laid = [lines for sweep in plan.sweeps() for lines in sweep.line_mm.tolist()]
    assert [list(p.line_mm) for p in passes] == laid
    # the sum of all samples at the rate of the converter, a turnaround each, and the stagger of a second kind
    seconds = plan.n_samples / (plan.array.n_whiskers * kinds) / plan.sample_rate_hz
    late_s = max(plan.array.offset_mm) * (1.0 / plan.speed_mm_s + 1.0 / RAPID_MM_S)
    assert plan.scan_time_s == pytest.approx(seconds + (plan.turnaround_s + late_s) * len(passes))
    assert math.fsum(p.stage_s for p in passes) == plan.scan_time_s


@pytest.mark.parametrize(
    "wrong",
    [{"line_mm": ()}, {"along_mm": (3.0, 3.0)}, {"speed_mm_s": 0.0}, {"preload_mm": -1.0}, {"lead_mm": -0.1},
     {"line_mm": (math.nan,)}],
)  # fmt: skip
def test_a_pass_that_cannot_be(wrong: dict[str, object]) -> None:
    with pytest.raises(WhiskerError):
        replace(ONE, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_raster_is_quasi_static(height: float) -> None:
    plan = default_plan((0.0, 0.0, 10.0, 10.0), character_height_mm=height)
    limit_hz = QUASI_STATIC_SHARE * first_bending_frequency_hz(default_whisker(height), tip_held=True)
    finest_mm = 4.0 * plan.line_pitch_mm
    assert SAFE_SPEED_MM_S / finest_mm <= limit_hz


def test_round_wire_is_no_faster_for_being_held_up() -> None:
    # the surface holds its height, not its sideways swing, which is as slow as that of the free whisker
    wire = straight_whisker(30.0, 0.0, Round(0.3))
    held, free = first_bending_frequency_hz(wire, tip_held=True), first_bending_frequency_hz(wire)
    assert held == pytest.approx(free, rel=1e-9)


# -------------------------------------------------------------------------------------------------------------- comb

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
