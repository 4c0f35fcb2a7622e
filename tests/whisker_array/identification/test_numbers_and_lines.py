"""Numbers of tips and benches, lines that are fitted, and their residuals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.surface.pieces import Piece, PieceKind
from tests.support.benches import recorded
from whisker_array.identification.residuals import START_ERROR, WALK, innovations
from whisker_array.identification.tip_numbers import SHAPE, tip_numbers, tip_of_numbers
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.defaults import default_whisker


@pytest.mark.parametrize("beta_deg", [0.0, 20.0, 45.0])
def test_a_tip_comes_back_but_for_a_factor(beta_deg: float) -> None:
    tip = replace(default_whisker(5.0), beta_rad=math.radians(beta_deg)).tip_model()
    factor = tip.compliance_mm_per_n[1, 1]
    again = tip_of_numbers(tip_numbers(tip))
    np.testing.assert_allclose(
        again.compliance_mm_per_n, tip.compliance_mm_per_n / factor, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(again.moment_arm_mm, tip.moment_arm_mm / factor, rtol=1e-9, atol=1e-12)


@given(st.lists(st.floats(-4.0, 4.0), min_size=SHAPE, max_size=SHAPE))
def test_of_any_numbers_there_is_a_tip(off: list[float]) -> None:
    """A steep beam's D11 is nearly singular, and a cloud around it must not leave what beams are: TipModel refuses."""
    steep = replace(default_whisker(5.0), beta_rad=math.radians(25.0)).tip_model()
    q = tip_numbers(steep)
    q[:SHAPE] += off
    np.testing.assert_allclose(tip_numbers(tip_of_numbers(q)), q, rtol=1e-6, atol=1e-6)


SCATTER, SAMPLES, LINES = 0.02, 400, 200


def missed(seed: int) -> np.ndarray:
    """(samples, lines) scatter about levels that walk as the module says."""
    rng = np.random.default_rng(seed)
    steps = WALK * SCATTER * rng.standard_normal((SAMPLES, LINES))
    steps[0] = START_ERROR * SCATTER * rng.standard_normal(LINES)
    return np.cumsum(steps, axis=0) + SCATTER * rng.standard_normal((SAMPLES, LINES))


def test_innovations_of_such_a_level_scatter_by_one_and_know_nothing_of_each_other() -> None:
    """80,000 samples: a correlation scatters by 0.0035, a variance by 0.005; four times that."""
    sigma = np.full(SAMPLES, SCATTER)
    left = innovations(missed(1), sigma, scatter=SCATTER)
    assert np.var(left) == pytest.approx(1.0, abs=0.02)
    for apart in (1, 2, 10, 50):
        assert np.mean(left[apart:] * left[:-apart]) == pytest.approx(0.0, abs=0.014)


def test_a_sample_that_is_not_used_says_nothing() -> None:
    sigma = np.full(SAMPLES, SCATTER)
    sigma[100:110] = np.inf
    values, other = missed(4), missed(4)
    other[100:110] += 1e3
    left, same = (innovations(v, sigma, scatter=SCATTER) for v in (values, other))
    np.testing.assert_array_equal(left, same)
    assert not left[100:110].any()


def chosen(scan: Scan) -> tuple[Trace, ...]:
    return traces_of(scan, most=24)


def test_drift_has_no_say_in_which_lines_are_fitted() -> None:
    """Chosen by their whole spread, lines that drift the way the plate rises would be taken, and the rise doubled."""
    scan = recorded(Piece(PieceKind.PITS))
    drift_n_mm = 0.02 * abs(scan.touch.land_moment_n_mm())
    sweeps = []
    for sweep in scan.sweeps:
        along = np.linspace(-drift_n_mm, drift_n_mm, sweep.moment_n_mm.shape[2])
        sign = np.where(np.arange(sweep.moment_n_mm.shape[0]) % 2, 1.0, -1.0)
        drifted = sweep.moment_n_mm + sign[:, None, None] * along
        sweeps.append(replace(sweep, moment_n_mm=drifted.astype(np.float32)))
    with_drift = chosen(replace(scan, sweeps=tuple(sweeps)))
    assert [t.line_mm for t in with_drift] == [t.line_mm for t in chosen(scan)]
