"""What speed adds to simulated moments: the response of one oscillator, and where nothing may be added."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from glyphs.surface.maps import HeightMap
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.at_speed import BLOCK, added_at_speed
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.ringing import Ringing, ringing_of
from whisker_array.whisker.sections import MUSIC_WIRE, Round
from whisker_array.whisker.shapes import straight_whisker
from whisker_array.whisker.touch import default_touch

HEIGHT = 5.0
TOUCH = default_touch(HEIGHT)
GAIN = 10.0
RATE_HZ = 800.0


def touch_of(held_hz: float, damping: float = 0.01) -> object:
    return replace(TOUCH, ringing=Ringing(held_hz, GAIN, damping))


def added(
    height_mm: NDArray[np.floating], touch: object = TOUCH, rate_hz: float = RATE_HZ
) -> NDArray[np.float64]:
    line = np.atleast_2d(np.asarray(height_mm, dtype=np.float32))
    out = added_at_speed(line, touch, sample_rate_hz=rate_hz)  # type: ignore[arg-type]
    return np.asarray(out, dtype=np.float64)


@pytest.mark.parametrize("held_hz", [60.0, 300.0, 1185.0])
def test_it_is_the_mean_over_each_sample_of_an_oscillator(held_hz: float) -> None:
    """x'' = w² (h - x) + 2 z w (h' - x'), and h - x is what rings; solved in time by scipy."""
    h = np.array([0.0, 0.0, -0.1, -0.2, -0.2, -0.2, -0.05, 0.0, 0.0, 0.0, 0.0])
    touch, w, z = touch_of(held_hz, 0.05), 2.0 * math.pi * held_hz, 0.05
    times = np.arange(h.size) / RATE_HZ

    def rate(t: float, x: NDArray[np.float64]) -> list[float]:
        climb = float(np.diff(h)[min(int(t * RATE_HZ), h.size - 2)]) * RATE_HZ
        return [x[1], w * w * (float(np.interp(t, times, h)) - x[0]) + 2.0 * z * w * (climb - x[1])]

    fine = np.linspace(0.0, times[-1], 400 * (h.size - 1) + 1)
    solved = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=fine, rtol=1e-9, atol=1e-12, max_step=1e-4)
    rings = np.interp(fine, times, h) - solved.y[0]
    expected = [rings[400 * j - 200 : 400 * j + 201].mean() for j in range(1, h.size - 1)]
    share = -GAIN * TOUCH.land_moment_n_mm() / TOUCH.preload_mm
    np.testing.assert_allclose(added(h, touch)[0, 1:-1], share * np.array(expected), atol=4e-4 * abs(share))


@given(height=st.floats(-0.9, 0.9), rate_hz=st.floats(10.0, 1e5))
def test_level_land_adds_nothing_at_any_height_and_speed(height: float, rate_hz: float) -> None:
    assert np.abs(added(np.full(50, height), rate_hz=rate_hz)).max() < 1e-4


def test_it_falls_with_the_square_of_the_speed() -> None:
    smooth = -0.2 * np.exp(-(((np.arange(200) - 100.0) / 20.0) ** 2))
    fast, slow = (np.abs(added(smooth, rate_hz=v / 0.0625)).max() for v in (40.0, 4.0))
    assert fast / slow == pytest.approx(100.0, rel=0.1)


def test_the_tip_rings_no_deeper_than_it_reaches() -> None:
    pit = np.where(np.abs(np.arange(60) - 30) < 5, -50.0, 0.0)
    reach = np.maximum(pit, -TOUCH.preload_mm)
    np.testing.assert_array_equal(added(pit), added(reach))


def test_many_lines_ring_as_each_alone() -> None:
    lines = np.random.default_rng(1).uniform(-0.3, 0.0, (2 * BLOCK + 3, 40))
    together = added(lines)
    for k in (0, BLOCK - 1, BLOCK, 2 * BLOCK + 2):
        np.testing.assert_array_equal(together[k], added(lines[k])[0])


def test_a_touch_without_a_known_whisker_is_as_on_a_slow_stage() -> None:
    assert not added(np.linspace(0.0, -0.3, 40), replace(TOUCH, ringing=None)).any()


def test_the_gain_grows_with_the_foot_and_not_with_the_section() -> None:
    wire, thick = (straight_whisker(30.0, 0.0, Round(d)) for d in (0.3, 0.5))
    assert ringing_of(wire).gain == ringing_of(thick).gain == 4.2
    assert TOUCH.ringing is not None
    assert TOUCH.ringing.gain > 10.0
    per = math.sqrt(MUSIC_WIRE.e_mpa * 0.3**2 / 16.0 / MUSIC_WIRE.density_t_mm3) / (2.0 * math.pi * 30.0**2)
    assert ringing_of(wire).held_hz == pytest.approx(3.9266**2 * per, rel=0.01)  # Blevins, table 8-1


def scan(part: HeightMap, *, fidelity: Fidelity, at_speed: bool, speed_mm_s: float = 50.0) -> Scan:
    plan = default_plan((0.5, 0.5, 5.5, 3.5), character_height_mm=HEIGHT, speed_mm_s=speed_mm_s)
    return trace_scan(part, touch=TOUCH, plan=plan, fidelity=fidelity, at_speed=at_speed)


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_a_scan_rings_in_both_fidelities_and_more_at_speed(fidelity: Fidelity) -> None:
    z = np.zeros((64, 96), dtype=np.float32)
    z[:, 40:56] = -0.2
    part = HeightMap(z, 0.0625)
    slow = scan(part, fidelity=fidelity, at_speed=False)
    errors = []
    for speed in (10.0, 30.0, 90.0):
        fast = scan(part, fidelity=fidelity, at_speed=True, speed_mm_s=speed)
        ways = list(zip(fast.sweeps, slow.sweeps, strict=True))
        assert all(np.array_equal(a.flags, b.flags) for a, b in ways)
        bad = [a.moment_n_mm[a.flags != 0] for a, _ in ways]
        assert all(
            np.array_equal(m, b.moment_n_mm[b.flags != 0]) for m, (_, b) in zip(bad, ways, strict=True)
        )
        errors.append(max(float(np.abs(a.moment_n_mm - b.moment_n_mm).max()) for a, b in ways))
    assert errors == sorted(errors)
    assert errors[0] < 0.05 * errors[2]
