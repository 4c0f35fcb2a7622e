"""The sensor chain: its statistics, its converter, and the calibration that undoes it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from tests.factories import ideal_chain
from whisker_array.scan.calibration import Calibration, apply_calibration, calibrate_lead_in
from whisker_array.scan.lead_in import calibrate_scan
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, SensorError, draw_sensor_chain, measure
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.touch import default_touch

# ------------------------------------------------------------------------------------------------------------ sensor

LAND = -6.5  # N mm, about default_whisker(5.0)
RATE = 1000.0
SIX_SIGMA = 6.0
LARGEST, N = 20.0, 200


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def run(moment: np.ndarray, chain: SensorChain) -> tuple[np.ndarray, np.ndarray]:
    return measure(moment.astype(np.float32), chain=chain, sample_rate_hz=RATE, rng=rng())


def test_ideal_chain_changes_nothing() -> None:
    moment = rng().standard_normal((2, 3, 50)).astype(np.float32)
    moment[0, 1, 7] = np.nan
    raw, saturated = run(moment, ideal_chain(3))
    np.testing.assert_array_equal(raw, moment)
    assert raw.dtype == np.float32
    assert not saturated.any()


def test_noise_has_its_rms_and_is_white() -> None:
    n = 20_000
    chain = SensorChain(np.ones(2), np.zeros(2), noise_n_mm=0.01)
    raw, _ = run(np.zeros((2, n)), chain)
    rms_error = 0.01 / math.sqrt(2 * n)
    assert abs(raw[0].std() - 0.01) < SIX_SIGMA * rms_error
    assert abs(raw[0].mean()) < SIX_SIGMA * 0.01 / math.sqrt(n)
    for other in (raw[1], np.roll(raw[0], 1)):
        assert abs(np.corrcoef(raw[0], other)[0, 1]) < SIX_SIGMA / math.sqrt(n)


def test_vibration_is_shared_by_the_whiskers_and_goes_with_the_moment() -> None:
    chain = SensorChain(np.ones(2), np.zeros(2), vibration=0.01)
    raw, _ = run(np.stack([np.full(5000, LAND), np.zeros(5000)]), chain)
    assert not raw[1].any()
    assert raw[0].std() == pytest.approx(0.01 * abs(LAND), rel=SIX_SIGMA / math.sqrt(2 * 5000))
    both, _ = run(np.full((2, 100), LAND), chain)
    np.testing.assert_array_equal(both[0], both[1])


def test_converter_rounds_to_the_nearest_count_and_clips() -> None:
    chain = SensorChain(np.ones(1), np.zeros(1), adc_range_n_mm=8.0, adc_bits=4)
    assert chain.adc_step_n_mm == 1.0
    raw, saturated = run(np.array([[0.4, 0.6, -3.49, 7.2, 7.6, -8.4, -8.6, 99.0, np.nan]]), chain)
    np.testing.assert_array_equal(raw[0], [0, 1, -3, 7, 7, -8, -8, 7, np.nan])
    assert saturated[0].tolist() == [False, False, False, False, True, False, True, True, False]


def test_drawn_chains_have_the_spread_asked_for() -> None:
    n = 4000
    chain = draw_sensor_chain(n, rng=rng(), gain_sd=0.03)
    assert chain.n_whiskers == n
    tolerance = SIX_SIGMA / math.sqrt(2 * n)
    assert chain.gain.std() == pytest.approx(
        0.03, rel=tolerance + 0.02
    )  # 2 %: draws beyond 3 sd are held back
    assert chain.offset_n_mm.std() == pytest.approx(0.2, rel=tolerance)
    assert abs(chain.gain.mean() - 1.0) < SIX_SIGMA * 0.03 / math.sqrt(n)
    assert chain.adc_bits == 16
    assert draw_sensor_chain(2, rng=rng(), adc_bits=None).adc_step_n_mm == 0.0


def test_noise_and_drift_are_the_figures() -> None:
    chain = draw_sensor_chain(N, rng=rng(), full_scale_n_mm=LARGEST, vibration=0.0, adc_bits=None)
    still = replace(chain, drift_n_mm_per_sqrt_s=0.0)
    raw, _ = measure(np.zeros((N, 200)), chain=still, sample_rate_hz=RATE, rng=rng(1))
    assert (raw - chain.offset_n_mm[:, None]).std() / LARGEST == pytest.approx(2e-4, rel=0.05)
    minute = replace(chain, noise_n_mm=0.0)
    raw, _ = measure(np.zeros((N, 600)), chain=minute, sample_rate_hz=10.0, rng=rng(2))
    walked = (raw[:, -1] - chain.offset_n_mm) / LARGEST
    assert walked.std() == pytest.approx(3e-3, rel=6.0 / np.sqrt(2 * N))


def test_drift_goes_on_from_pass_to_pass() -> None:
    chain = replace(draw_sensor_chain(N, rng=rng()), noise_n_mm=0.0, vibration=0.0, adc_bits=None)
    drift_n_mm = np.zeros(N)
    for seed in range(6):
        raw, _ = measure(
            np.zeros((10, N, 50)),
            chain=chain,
            sample_rate_hz=10.0,
            rng=rng(seed),
            drift_n_mm=drift_n_mm,
            pause_s=5.0,
        )
    walked = raw[-1, :, -1] - chain.offset_n_mm
    seconds = 60 * (5.0 + 5.0)
    expected = chain.drift_n_mm_per_sqrt_s * np.sqrt(seconds)
    assert walked.std() == pytest.approx(expected, rel=6.0 / np.sqrt(2 * N))


def lead_in(n: int = 3, noise: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    g = rng(9)
    return noise * g.standard_normal((n, 100)), LAND + noise * g.standard_normal((n, 100))


AIR, ON_LAND = lead_in()
ONE = np.ones(1)


@pytest.mark.parametrize(
    ("air", "land", "expected", "said"),
    [
        (AIR, ON_LAND[:, :5], LAND, "5 samples of land"),
        (AIR, np.stack([ON_LAND[0], AIR[1], ON_LAND[2]]), LAND, r"whiskers 1: .*does not stand out"),
        (AIR, ON_LAND, -LAND, "wrong sign"),
        (*lead_in(noise=2.0), LAND, r"whiskers 0, 1, 2: .*too noisy"),
        (*lead_in(n=12, noise=50.0), LAND, "does not stand out"),
        (AIR, ON_LAND, 0.0, "must not be 0"),
        (AIR[:2], ON_LAND, LAND, r"\(whiskers, samples\)"),
        (AIR, np.where(np.arange(100) == 0, np.nan, ON_LAND), LAND, "land is not finite"),
    ],
)
def test_lead_in_refusals(air: np.ndarray, land: np.ndarray, expected: float, said: str) -> None:
    with pytest.raises(SensorError, match=said):
        calibrate_lead_in(air, land, expected_land_moment_n_mm=expected)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: SensorChain(np.ones(2), np.zeros(1)), "offset_n_mm has shape"),
        (lambda: Calibration(np.zeros(1), np.zeros(1)), "whisker 0 has a gain of 0"),
        (lambda: SensorChain(np.array([np.nan]), ONE), "gain has values out of range"),
        (lambda: SensorChain(ONE, ONE, noise_n_mm=-1.0), "noise_n_mm"),
        (lambda: SensorChain(ONE, ONE, adc_range_n_mm=1.0, adc_bits=1), "adc_bits is 1"),
        (lambda: SensorChain(ONE, ONE, adc_bits=16), "adc_range_n_mm is inf"),
        (lambda: SensorChain(ONE, ONE, adc_range_n_mm=0.0), "adc_range_n_mm is 0"),
        (lambda: ideal_chain(0), "one for each whisker"),
        (lambda: draw_sensor_chain(1, rng=rng(), gain_sd=0.5), "gain_sd"),
        (lambda: draw_sensor_chain(1, rng=rng(), full_scale_n_mm=math.nan), "full_scale_n_mm"),
        (lambda: run(np.zeros((2, 5)), ideal_chain(1)), "1 whiskers, samples"),
        (
            lambda: measure(np.zeros((1, 5)), chain=ideal_chain(1), sample_rate_hz=0.0, rng=rng()),
            "sample_rate_hz",
        ),
        (lambda: apply_calibration(np.zeros(5), Calibration(ONE, ONE)), "raw has shape"),
    ],
)
def test_refusals_say_what_is_wrong(make: Callable[[], object], said: str) -> None:
    with pytest.raises(SensorError, match=said):
        make()


# ----------------------------------------------------------------------------------------------------------- lead in


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
