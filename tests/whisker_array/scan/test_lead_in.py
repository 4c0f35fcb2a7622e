"""Calibration of a scan from its own lead-in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from tests.factories import ideal_chain
from whisker_array.scan.lead_in import calibrate_scan
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, SensorError, draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.touch import default_touch


def scan_with(chain: SensorChain, *, lead_mm: float = 2.0, air_samples: int = 16) -> Scan:
    plan = RasterPlan(
        array=WhiskerArray(4, 1.0),
        region_mm=(2.0, 0.0, 8.0, 2.9),
        line_pitch_mm=0.25,
        sample_pitch_mm=0.1,
        directions=RasterPlan.__dataclass_fields__["directions"].default[:1],
        lead_mm=lead_mm,
        air_samples=air_samples,
    )
    flat = HeightMap(np.zeros((40, 120), np.float32), 0.1)
    rng = np.random.default_rng(0)
    return trace_scan(
        flat, touch=default_touch(5.0), plan=plan, fidelity=Fidelity.POINTWISE, sensor=chain, rng=rng
    )


def test_gain_and_offset_are_found() -> None:
    chain = draw_sensor_chain(4, rng=np.random.default_rng(4))
    scan = scan_with(chain)
    found = calibrate_scan(scan)
    np.testing.assert_allclose(found.calibration.gain, chain.gain, rtol=2e-3)
    # the zero walks by 0.008 N mm in a second, and on from pass to pass
    np.testing.assert_allclose(found.calibration.offset_n_mm, chain.offset_n_mm, atol=0.04)
    # what is left is noise, drift and vibration: a few thousandths of the moment on the land
    assert (found.residual_n_mm < 0.01 * abs(default_touch(5.0).land_moment_n_mm())).all()
    assert (found.residual_n_mm > 0.0).all()
    assert (found.air_samples > 0).all()
    assert found.land_samples.tolist() == [20 * scan.sweeps[0].plan.line_mm.shape[0]] * 4


def test_a_whisker_that_never_ran_in_keeps_its_gain() -> None:
    chain = draw_sensor_chain(4, rng=np.random.default_rng(4))
    scan = scan_with(chain)
    flags = scan.sweeps[0].flags.copy()
    flags[:, 2, 0] = 8
    found = calibrate_scan(replace(scan, sweeps=(replace(scan.sweeps[0], flags=flags),)))
    assert found.land_samples[2] == 0
    assert found.calibration.gain[2] == 1.0
    assert found.calibration.offset_n_mm[2] == pytest.approx(chain.offset_n_mm[2], abs=0.04)


def test_what_gives_no_calibration_is_said() -> None:
    ideal = ideal_chain(4)
    with pytest.raises(SensorError, match="lead-in"):
        calibrate_scan(scan_with(ideal, lead_mm=0.0))
    with pytest.raises(SensorError, match="air"):
        calibrate_scan(scan_with(ideal, air_samples=0))
    broken = SensorChain(np.array([1.0, 1e-9, 1.0, 1.0]), np.zeros(4), noise_n_mm=0.01)
    with pytest.raises(SensorError, match="whisker 1"):
        calibrate_scan(scan_with(broken))
