"""Which lines of a recording are fitted, and how their samples are whitened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.pieces import Piece, PieceKind
from tests.support.benches import recorded
from whisker_array.identification.fit import LEVEL_DEGREE, LEVEL_SD, PIXEL, Whitener
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.scan import Scan

SCATTER, SAMPLES, LINES = 0.02, 400, 400


def whitener(scan: Scan) -> Whitener:
    """Of a line of land with ten unusable samples."""
    land = np.ones(SAMPLES)
    land[100:110] = np.nan
    return Whitener(replace(chosen(scan)[0], measured_n_mm=land), SCATTER, place_mm=0.0)


def test_whitened_samples_scatter_by_one_and_know_nothing_of_each_other() -> None:
    """38,800 pixels: a correlation scatters by 0.005, a variance by 0.007; four times that."""
    rng = np.random.default_rng(1)
    shapes = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, SAMPLES), LEVEL_DEGREE)
    drift = LEVEL_SD * SCATTER * shapes @ rng.standard_normal((LEVEL_DEGREE + 1, LINES))
    residuals = whitener(recorded(Piece(PieceKind.PITS)))(
        drift + SCATTER * rng.standard_normal((SAMPLES, LINES))
    )
    used = np.delete(residuals, slice(100 // PIXEL, -(-110 // PIXEL)), axis=0)
    assert np.var(used) == pytest.approx(1.0, abs=0.03)
    for apart in (1, 2, 10):
        assert np.mean(used[apart:] * used[:-apart]) == pytest.approx(0.0, abs=0.02)


def test_a_sample_that_is_not_used_says_nothing() -> None:
    whiten, values = whitener(recorded(Piece(PieceKind.PITS))), np.ones((SAMPLES, 1))
    other = values.copy()
    other[100:110] += 1e3
    np.testing.assert_array_equal(whiten(values), whiten(other))


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
