"""The compiled loops of the land against the plain formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from whisker_array.estimation.edges import UNUSABLE, ordered_lines
from whisker_array.estimation.land import (
    DAMPING,
    LAND_SHARE,
    MIN_INLIERS,
    TUKEY_CUT,
    divide_by_land,
    land_coefficients,
    line_drift,
    plate_land,
    remove_drift,
    shorth,
    whisker_gain,
)
from whisker_array.estimation.land_fit import fit_quadratic, robust_lines, running_median

Lines = NDArray[np.float64]
CUTS = np.array([0.2, 0.1, 0.07, TUKEY_CUT, TUKEY_CUT])


def sweep(shape: tuple[int, int], seed: int, *, holes: float = 0.0) -> Lines:
    """A tilted, domed land of moment about 2 with noise, grooves in a third of it, and samples missing."""
    rng = np.random.default_rng(seed)
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    out = 2.0 * (1.0 + 0.05 * u - 0.08 * v + 0.02 * u * u - 0.01 * u * v) + rng.normal(0.0, 0.01, shape)
    out[:, :: shape[1] // 8] *= 0.8
    out[shape[0] // 3 : shape[0] // 2, shape[1] // 4 : shape[1] // 2] *= 1.2
    out[rng.uniform(size=shape) < holes] = np.nan
    return out


def plain_quadratic(target: Lines, u: Lines, v: Lines, level: float, start: Lines) -> tuple[Lines, float]:
    """Iteratively reweighted least squares over a list of samples, by the textbook."""
    vv, uu = np.meshgrid(v, u, indexing="ij")
    known = np.isfinite(target)
    x, y, z = uu[known], vv[known], target[known]
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    expected, coefficients = design @ start, np.array([level, 0, 0, 0, 0, 0], dtype=float)
    for cut in CUTS * level:
        weight = np.clip(1.0 - ((z - expected) / cut) ** 2, 0.0, None) ** 2
        if weight.sum() < 12:
            break
        normal = (design * weight[:, None]).T @ design
        normal[np.diag_indices(6)] += DAMPING * np.trace(normal)
        coefficients = np.linalg.solve(normal, (design * weight[:, None]).T @ z)
        expected = design @ coefficients
    return coefficients, float((np.abs(z - expected) < 0.5 * TUKEY_CUT * level).mean())


@pytest.mark.parametrize("holes", [0.0, 0.3])
@pytest.mark.parametrize("start", [(2.0, 0, 0, 0, 0, 0), (2.0, 0.1, -0.2, 0, 0, 0), (9.0, 0, 0, 0, 0, 0)])
def test_the_quadratic_is_that_of_the_textbook(start: tuple[float, ...], holes: float) -> None:
    thin = sweep((37, 52), 4, holes=holes)
    u, v = np.linspace(-1, 1, 52), np.linspace(-1, 1, 37)
    expected, share = plain_quadratic(thin, u, v, 2.0, np.array(start))
    got = np.array(start)
    explained = fit_quadratic(thin, u, v, 2.0, 2.0 * CUTS, DAMPING, 0.5 * TUKEY_CUT * 2.0, got)
    # sums in another order
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-10)
    assert explained == pytest.approx(share, abs=1e-12)


def plain_lines(ratio: Lines) -> tuple[Lines, Lines]:
    samples = ratio.shape[1]
    t = np.linspace(-1.0, 1.0, samples)
    offsets, slopes = [], []
    for line in ratio:
        known = np.isfinite(line)
        x, y, (o, s) = t[known], line[known], (1.0, 0.0)
        for _ in range(3):
            w = np.clip(1.0 - ((y - o - s * x) / TUKEY_CUT) ** 2, 0.0, None) ** 2
            total = w.sum() + 1e-9
            mx, my = (w * x).sum() / total, (w * y).sum() / total
            s = ((w * x * y).sum() - total * mx * my) / ((w * x * x).sum() - total * mx * mx + 0.05 * samples)
            o = my - s * mx
            if total < MIN_INLIERS * samples:
                o, s = 1.0, 0.0
        offsets.append(o)
        slopes.append(s)
    return np.array(offsets), np.array(slopes)


def test_robust_lines_are_those_of_the_plain_sums() -> None:
    ratio = sweep((23, 71), 5, holes=0.2) / 2.0
    ratio[3] += 0.5  # a line in a mark throughout
    ratio[4] = np.nan
    offset, slope, few = np.empty(23), np.empty(23), np.empty(23, dtype=np.bool_)
    t = np.linspace(-1.0, 1.0, 71)
    robust_lines(ratio, t, TUKEY_CUT, MIN_INLIERS * 71, 0.05 * 71, offset, slope, few)
    expected = plain_lines(ratio)
    np.testing.assert_allclose(offset, expected[0], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(slope, expected[1], rtol=0.0, atol=1e-12)
    assert few[[3, 4]].all()
    assert not few[5:].all()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 30), size=st.integers(1, 11))
def test_running_median_is_that_of_scipy(seed: int, n: int, size: int) -> None:
    values = np.round(np.random.default_rng(seed).normal(size=n), 1)  # with ties
    expected = ndimage.median_filter(values, size=size, mode="nearest")
    np.testing.assert_array_equal(running_median(values, size), expected)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 60))
def test_shorth_is_the_first_of_the_shortest_intervals(seed: int, n: int) -> None:
    values = np.round(np.random.default_rng(seed).normal(size=n), 1)
    ordered, width = np.sort(values), max(1, int(LAND_SHARE * n))
    gaps = [ordered[i + width - 1] - ordered[i] for i in range(n - width + 1)]
    first = int(np.argmin(gaps))
    assert shorth(values[None])[0] == 0.5 * (ordered[first] + ordered[first + width - 1])


def test_in_place_is_as_written_out() -> None:
    moment = sweep((31, 64), 6, holes=0.1)
    ratio = moment / plate_land(moment)
    # the polynomial is summed in another order
    np.testing.assert_allclose(divide_by_land(moment.copy(), land_coefficients(moment)), ratio, rtol=1e-13)
    np.testing.assert_allclose(remove_drift(ratio.copy()), ratio / line_drift(ratio) - 1.0, atol=1e-13)


def test_lines_come_in_order_without_offset_lead_and_flagged_samples() -> None:
    rng = np.random.default_rng(7)
    signal = rng.normal(size=(6, 12)).astype(np.float32)
    flags = rng.choice(np.array([0, 2, 128], dtype=np.uint8), size=signal.shape)
    flags[4] = 2
    offset, order = rng.normal(size=6), rng.permutation(6)
    lines = ordered_lines(signal, flags, offset, order, 2)
    expected = np.where(flags & UNUSABLE, np.nan, signal.astype(np.float64) - offset[:, None])[order, 2:10]
    np.testing.assert_array_equal(lines, expected)


def test_gains_are_reconciled_medians_of_logarithms() -> None:
    lines = sweep((24, 60), 8, holes=0.2)
    whisker = np.repeat(np.arange(3), 8)
    lines[8:16] *= 1.05
    lines[7, 5:] = np.nan  # too few samples to tell the first border
    step = np.nanmedian(np.log(np.abs(lines[1:] / lines[:-1])), axis=1)
    beside = 0.5 * (step[14] + step[16])
    gain = whisker_gain(lines, whisker)
    assert np.log(gain[16] / gain[15]) == pytest.approx(step[15] - beside, abs=1e-12)
    assert np.log(gain).reshape(3, 8).mean(axis=1).sum() == pytest.approx(0.0, abs=1e-12)
