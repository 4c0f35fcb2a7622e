"""The raster plan: every line once, at its place, in the time that it states; its passes."""

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
    LINES_PER_HEIGHT,
    SAFE_SPEED_MM_S,
    RasterPlan,
    WhiskerArray,
    default_plan,
)
from whisker_array.whisker.defaults import default_whisker
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


@settings(max_examples=50, deadline=None)
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


@settings(max_examples=50, deadline=None)
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
    assert limit_hz * finest_mm == pytest.approx(59.0, abs=0.5)


def test_round_wire_is_no_faster_for_being_held_up() -> None:
    # the surface holds its height, not its sideways swing, which is as slow as that of the free whisker
    wire = straight_whisker(30.0, 0.0, Round(0.3))
    held, free = first_bending_frequency_hz(wire, tip_held=True), first_bending_frequency_hz(wire)
    assert held == pytest.approx(free, rel=1e-9)
