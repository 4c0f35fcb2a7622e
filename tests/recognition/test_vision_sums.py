"""Compiled sums over settings against numpy's sums of logarithms, narrow and too wide for a double."""

from __future__ import annotations

import numpy as np
import pytest

from recognition import vision_sums as vision_sums
from recognition.vision_sums import WIDEST, exponentials, gathered, log_sum, moved

EXACT = 1e-11
"""Of logarithms up to some thousand in double precision."""
WIDTH, COLS = 40, 25
AT, TO = np.array([2, 5, 1]), np.array([9, 3, 12])
PRIOR = np.array([np.log(0.5), -np.inf, np.log(0.5)])


def plain_gathered(evidence: np.ndarray, here: np.ndarray) -> np.ndarray:
    out = np.full(WIDTH, -np.inf)
    for c in range(AT.size):
        for x in range(COLS):
            out[x + TO[c]] = np.logaddexp(out[x + TO[c]], evidence[c, x] + PRIOR[c] + here[x + AT[c]])
    return out


def plain_moved(value: np.ndarray, low: int, gaps: np.ndarray, sign: int) -> np.ndarray:
    out = np.full(WIDTH, -np.inf)
    for y in range(WIDTH):
        for n, gap in enumerate(gaps):
            if 0 <= y - sign * (low + n) < WIDTH:
                out[y] = np.logaddexp(out[y], value[y - sign * (low + n)] + gap)
    return out


@pytest.mark.parametrize("spread", [1.0, 100.0, 3000.0])
def test_gathering(spread: float) -> None:
    rng = np.random.default_rng(3)
    evidence, here = rng.normal(0.0, spread, (3, COLS)), rng.normal(0.0, spread, WIDTH)
    here[:4] = -np.inf
    scaled = exponentials(evidence)
    # both ways of summing are met
    assert (scaled[2] > WIDEST) == (spread > 1000.0)
    out = np.empty(WIDTH)
    gathered(evidence, scaled, PRIOR, here, AT, TO, out)
    np.testing.assert_allclose(out, plain_gathered(evidence, here), rtol=EXACT, atol=EXACT)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("low", [-3, 0, 2])
@pytest.mark.parametrize("spread", [1.0, 100.0, 3000.0])
def test_moving(spread: float, low: int, sign: int) -> None:
    rng = np.random.default_rng(4)
    value, gaps = rng.normal(0.0, spread, WIDTH), np.append(rng.normal(-3.0, 1.0, 7), -np.inf)
    value[10:13] = -np.inf
    out = np.empty(WIDTH)
    moved(value, low, gaps, sign, out)
    np.testing.assert_allclose(out, plain_moved(value, low, gaps, sign), rtol=EXACT, atol=EXACT)


def test_nothing_comes_of_nothing() -> None:
    nothing, out = np.full(WIDTH, -np.inf), np.empty(WIDTH)
    evidence = np.zeros((3, COLS))
    gathered(evidence, exponentials(evidence), PRIOR, nothing, AT, TO, out)
    assert np.isneginf(out).all()
    moved(nothing, 0, np.zeros(3), 1, out)
    assert np.isneginf(out).all()
    assert np.isneginf(log_sum(nothing))


def test_what_is_left_out_is_below_rounding() -> None:
    # a thousand such terms do not move the sum by a unit in the last place
    assert 1000.0 * np.exp(-vision_sums.NOTHING) < np.finfo(np.float64).eps
    values = np.random.default_rng(5).normal(0.0, 30.0, 200)
    assert log_sum(values) == pytest.approx(np.logaddexp.reduce(values), rel=1e-14)
