"""Passes of the array, and limits of the linear beam."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from glyphs.surface.maps import TraceDirection
from whisker_array.whisker.array import SAFE_SPEED_MM_S, default_plan
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.passes import RAPID_MM_S, Pass
from whisker_array.whisker.sections import Round, WhiskerError
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.validity import QUASI_STATIC_SHARE, first_bending_frequency_hz

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
