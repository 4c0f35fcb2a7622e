"""Where a line may lie: on pictures drawn for the purpose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.localise import activity_of, bands, line_rotation_deg, percentile

PITCH = 0.1


def bars(angle_deg: float, *, height: float = 40.0, shape: tuple[int, int] = (200, 420)) -> np.ndarray:
    """A turned line of upright bars, 12 pixels apart, `height` pixels tall."""
    rows, cols = shape
    y, x = np.mgrid[:rows, :cols].astype(np.float64)
    x, y = x - 0.5 * (cols - 1), y - 0.5 * (rows - 1)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    u, v = c * x + s * y, -s * x + c * y
    bar = (np.abs(v) < 0.5 * height) & (np.abs(u) < 150.0) & (np.abs(u % 12.0 - 6.0) < 2.0)
    return bar.astype(np.float64)


@settings(max_examples=15, deadline=None)
@given(st.floats(-9.0, 9.0))
def test_the_rotation_of_drawn_bars_is_found(angle: float) -> None:
    found = line_rotation_deg(bars(angle))
    # half a step of the sweep; below two degrees a sharper row may not stand out, and reads as it lies
    assert found == pytest.approx(angle, abs=0.5) or (found == 0.0 and abs(angle) < 2.0)


def test_little_or_even_activity_has_no_rotation() -> None:
    few = np.zeros((60, 80))
    few[30, 20:60] = 1.0
    assert line_rotation_deg(few) == 0.0
    even = np.random.default_rng(0).uniform(0.5, 1.0, (150, 150))
    assert line_rotation_deg(even) == 0.0


def test_activity_is_clipped_and_never_negative() -> None:
    layers = np.random.default_rng(1).normal(size=(2, 50, 60)).astype(np.float32)
    layers[:, 3, 4] = 1000.0
    activity = activity_of(layers)
    assert activity.min() == 0.0
    # the chip is no louder than the loudest three percent
    assert activity[3, 4] == activity.max()
    assert (activity == activity.max()).mean() == pytest.approx(0.03, abs=0.005)


def test_activity_scales_with_the_square() -> None:
    layers = np.random.default_rng(2).normal(size=(2, 40, 50)).astype(np.float32)
    np.testing.assert_allclose(activity_of(3.0 * layers), 9.0 * activity_of(layers), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("height", [60.0, 80.0, 120.0])
def test_the_first_band_is_as_tall_as_the_bars(height: float) -> None:
    found = bands(bars(0.0, height=height), pitch_mm=PITCH)
    # smoothing over a sixtieth of the rows on either side, seen at 15 % of the level
    assert found[0].height_mm == pytest.approx(height * PITCH, abs=0.2 * height * PITCH)
    assert found[0].middle_mm == pytest.approx(0.5 * 199 * PITCH, abs=2 * PITCH)


def test_two_lines_are_two_bands() -> None:
    activity = np.zeros((200, 300))
    activity[20:60, 20:280] = 1.0
    activity[110:180, 20:280] = 1.0
    middles = sorted(b.middle_mm for b in bands(activity, pitch_mm=PITCH))
    assert middles[0] == pytest.approx(39.5 * PITCH, abs=2 * PITCH)
    assert middles[-1] == pytest.approx(144.5 * PITCH, abs=2 * PITCH)


def test_bands_differ_and_are_no_more_than_asked_for() -> None:
    rng = np.random.default_rng(3)
    activity = rng.uniform(0.0, 1.0, (200, 1)) ** 3 * rng.uniform(0.5, 1.0, (200, 50))
    found = bands(activity, pitch_mm=PITCH, most=3)
    assert len(found) <= 3
    for i, a in enumerate(found):
        for b in found[:i]:
            apart = abs(a.middle_mm - b.middle_mm) >= 0.1 * max(a.height_mm, b.height_mm)
            assert apart or abs(np.log(a.height_mm / b.height_mm)) >= 0.1


def test_no_activity_is_no_band() -> None:
    assert bands(np.zeros((100, 100)), pitch_mm=PITCH) == ()
    assert bands(np.ones((100, 100)), pitch_mm=PITCH) == ()


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60), st.floats(0.0, 100.0), st.integers(0, 2**32 - 1))
def test_percentiles_are_numpy_s(n: int, percent: float, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=n)
    assert percentile(values, percent) == pytest.approx(float(np.percentile(values, percent)), abs=1e-9)
