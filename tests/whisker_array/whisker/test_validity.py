"""The frequency at which a scan is quasi-static, with the tip held on the surface."""

from __future__ import annotations

import pytest

from whisker_array.whisker.array import SAFE_SPEED_MM_S, default_plan
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.validity import QUASI_STATIC_SHARE, first_bending_frequency_hz


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
