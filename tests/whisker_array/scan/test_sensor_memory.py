"""Creep and hysteresis: the figures asked for, limits without them, and an independent solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.errors import MarksError
from tests.factories import ideal_chain
from whisker_array.scan.sensor import draw_sensor_chain, measure
from whisker_array.scan.sensor_memory import (
    CREEP,
    HOLD_S,
    SHIFT_AFTER_CYCLES,
    ZERO_SHIFT,
    SensorMemory,
    SensorState,
    draw_memory,
    read_gauges,
)

LARGEST = 20.0
RATE = 100.0
N = 200


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def drawn(n: int = N) -> SensorMemory:
    return draw_memory(n, rng=rng(1), largest_n_mm=LARGEST)


def read(load: np.ndarray, memory: SensorMemory, *, rate: float = RATE) -> np.ndarray:
    """Readings of one load, (samples,), by every whisker."""
    n = memory.creep.shape[0]
    state = SensorState.at_rest(n, memory)
    return read_gauges(np.broadcast_to(load, (n, load.size)), memory=memory, state=state, step_s=1.0 / rate)


def cycles(n: int) -> np.ndarray:
    """Loads of so many cycles, the largest for `HOLD_S` and none for as long, one sample a step."""
    hold = int(HOLD_S * RATE)
    return np.tile(np.repeat([LARGEST, 0.0], hold), n)


def test_a_held_load_creeps_by_the_figures() -> None:
    reading = read(np.full(int(HOLD_S * RATE) + 1, LARGEST), drawn()) / LARGEST
    crept = reading[:, -1] - reading[:, 0]
    # the first sample has crept for a hundredth of a second: at most 0.05 % of L
    assert crept.min() > CREEP[0] - 5e-4
    assert crept.max() < CREEP[1] + 5e-4
    assert np.ptp(crept) > 0.5 * (CREEP[1] - CREEP[0])  # whiskers differ
    assert reading[:, 0] == pytest.approx(1.0, abs=5e-4)  # and the first way up is straight


def test_the_zero_shifts_by_the_figures_after_one_unloading_and_after_ten() -> None:
    hold = int(HOLD_S * RATE)
    reading = read(cycles(10), drawn()) / LARGEST
    first, tenth = reading[:, hold], reading[:, 19 * hold]
    # what plays leave to creep, and the sample that has rested: 0.1 % of L
    assert ZERO_SHIFT[0] - 1e-3 < first.min() < ZERO_SHIFT[0] + 1e-3
    assert ZERO_SHIFT[1] - 1e-3 < first.max() < ZERO_SHIFT[1] + 1e-3
    assert tenth == pytest.approx(SHIFT_AFTER_CYCLES, abs=1e-3)


def test_noise_and_drift_are_the_figures() -> None:
    chain = draw_sensor_chain(N, rng=rng(), full_scale_n_mm=LARGEST, vibration=0.0, adc_bits=None)
    still = replace(chain, drift_n_mm_per_sqrt_s=0.0, memory=None)
    raw, _ = measure(np.zeros((N, 200)), chain=still, sample_rate_hz=RATE, rng=rng(1))
    assert (raw - chain.offset_n_mm[:, None]).std() / LARGEST == pytest.approx(2e-4, rel=0.05)
    minute = replace(chain, noise_n_mm=0.0)
    raw, _ = measure(np.zeros((N, 600)), chain=minute, sample_rate_hz=10.0, rng=rng(2))
    walked = (raw[:, -1] - chain.offset_n_mm) / LARGEST
    assert walked.std() == pytest.approx(3e-3, rel=6.0 / np.sqrt(2 * N))


def test_drift_goes_on_from_pass_to_pass() -> None:
    chain = replace(
        draw_sensor_chain(N, rng=rng(), memory=False), noise_n_mm=0.0, vibration=0.0, adc_bits=None
    )
    state = chain.at_rest()
    for seed in range(6):
        raw, _ = measure(
            np.zeros((10, N, 50)), chain=chain, sample_rate_hz=10.0, rng=rng(seed), state=state, pause_s=5.0
        )
    walked = raw[-1, :, -1] - chain.offset_n_mm
    seconds = 60 * (5.0 + 5.0)
    expected = chain.drift_n_mm_per_sqrt_s * np.sqrt(seconds)
    assert walked.std() == pytest.approx(expected, rel=6.0 / np.sqrt(2 * N))


def test_creep_alone_is_the_solution_of_the_kelvin_voigt_chain() -> None:
    """Against scipy's integration of tau dq/dt = x - q for a load that rises and falls."""
    from scipy.integrate import solve_ivp

    memory = replace(drawn(2), play_weight=np.zeros((2, 4)))
    t = np.arange(1, 4001) / 1000.0
    load = LARGEST * np.sin(t) ** 2
    solved = solve_ivp(
        lambda s, q: (LARGEST * np.sin(s) ** 2 - q) / memory.relax_s, (0.0, t[-1]), np.zeros(3),
        t_eval=t, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    expected = load + memory.creep @ solved.y
    # first order in the step: half a step of the fastest change, of 1 % of the load
    np.testing.assert_allclose(read(load, memory, rate=1000.0), expected, atol=1e-3 * 0.5 * LARGEST * 0.02)


def test_plays_alone_know_no_time_and_lie_apart_by_the_way() -> None:
    memory = replace(drawn(4), creep=np.zeros((4, 3)))
    way = np.concatenate([np.linspace(0, LARGEST, 200), np.linspace(LARGEST, 0, 200)])
    quick, slow = read(way, memory), read(np.repeat(way, 3), memory)[:, 2::3]
    np.testing.assert_array_equal(quick, slow)
    up, down = quick[:, :200], quick[:, :199:-1]
    assert (down - up)[:, 5:195].min() > 0.0
    np.testing.assert_allclose(up[:, -1], LARGEST)
    # a closed loop comes back to itself (wiping out): the second way round is the third
    again = read(np.tile(way, 3), memory)
    np.testing.assert_allclose(again[:, 400:800], again[:, 800:], atol=1e-12)


def test_the_chain_carries_its_state_and_lifts_between_passes() -> None:
    chain = replace(ideal_chain(2), memory=drawn(2))
    load = np.stack([np.full((2, 30), -15.0), np.zeros((2, 30))]).astype(np.float32)
    both, _ = measure(load, chain=chain, sample_rate_hz=RATE, rng=rng())
    state = chain.at_rest()
    apart = [measure(one, chain=chain, sample_rate_hz=RATE, rng=rng(), state=state)[0] for one in load]
    np.testing.assert_array_equal(np.stack(apart), both)
    # what hangs in air for ten minutes has forgotten what crept, and keeps what its plays hold
    rested, _ = measure(load, chain=chain, sample_rate_hz=RATE, rng=rng(), pause_s=600.0)
    assert (np.abs(rested[1, :, 0]) < np.abs(both[1, :, 0])).all()
    assert (np.abs(rested[1, :, 0]) > 0.0).all()


def test_what_is_not_felt_loads_nothing() -> None:
    memory = drawn(2)
    load = np.array([5.0, np.nan, 5.0])
    reading = read(load, memory)
    assert np.isnan(reading[:, 1]).all()
    np.testing.assert_array_equal(reading[:, 2], read(np.array([5.0, 0.0, 5.0]), memory)[:, 2])


def test_refusals_say_what_is_wrong() -> None:
    memory = drawn(2)
    with pytest.raises(MarksError, match="creep has values out of range"):
        replace(memory, creep=-memory.creep)
    with pytest.raises(MarksError, match="has shape"):
        replace(memory, creep=memory.creep[:, :2])
    with pytest.raises(MarksError, match="largest_n_mm is 0"):
        replace(memory, largest_n_mm=0.0)
    with pytest.raises(MarksError, match="weigh 1 or more"):
        replace(memory, play_weight=memory.play_weight + 1.0)
    with pytest.raises(MarksError, match="memory of 2 whiskers"):
        replace(draw_sensor_chain(3, rng=rng()), memory=memory)
