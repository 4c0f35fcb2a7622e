"""A bench's numbers found again from its recording: which lines are fitted, how they are whitened, what is found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.surface.maps import HeightMap, MapError
from glyphs.surface.pieces import Piece, PieceKind
from pipeline.reading.identified import confounded, undetermined
from tests.support.benches import recorded, worn
from whisker_array.identification.bench import BENCH_GAIN, Bench, Unknown, nominal_bench, prior_sd
from whisker_array.identification.fit import LEVEL_DEGREE, LEVEL_SD, PIXEL, IdentifyError, Whitener, identify
from whisker_array.identification.piece_map import heights_of
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

# --------------------------------------------------------------------------------------------------------------- fit

PIECE = Piece(angle_deg=(45.0, 30.0), floor_mm=1.0, land_mm=1.5)
COARSE_MM, FINER_MM = 0.02, 0.016
"""Grids of the fit. The coarse one is for what does not ask how near the numbers are."""
FEW = (Unknown.STIFFNESS, Unknown.RADIUS, Unknown.PRELOAD, Unknown.FRICTION)


@pytest.fixture(scope="module")
def scan() -> Scan:
    return recorded(PIECE)


def test_what_the_recording_tells_is_found_and_the_rest_is_named() -> None:
    """Radius within 10 %, friction 0.03, preload 0.5 %: of a short recording, dragged alone, coarse map."""
    scan = recorded(PIECE, touch=worn(0.08, 1.04), friction=0.27)
    found = identify(scan, PIECE.height_mm, whisker=default_whisker(5.0), grid_mm=FINER_MM)
    assert found.settled
    assert found.of(Unknown.RADIUS)[0] == pytest.approx(0.08, rel=0.1)
    assert found.of(Unknown.FRICTION)[0] == pytest.approx(0.27, abs=0.03)
    assert found.of(Unknown.PRELOAD)[0] == pytest.approx(1.04, rel=5e-3)
    assert found.misfit < 1.5
    for name, true in ((Unknown.RADIUS, 0.08), (Unknown.FRICTION, 0.27), (Unknown.PRELOAD, 1.04)):
        value, sd = found.of(name)
        assert abs(value - true) < 4.0 * sd
    # only the product of stiffness and gain is in a quasi-static signal
    shared = next(group for group in confounded(found) if "stiffness" in group)
    assert "gains" in shared
    product = found.sd_of(lambda bench: bench[Unknown.STIFFNESS] * float(bench.gain.mean()))
    assert product < 0.5 * found.of(Unknown.STIFFNESS)[1]
    assert Unknown.FRICTION not in undetermined(found)


def test_gains_that_a_bench_has_shown_tell_the_stiffness(scan: Scan) -> None:
    how: Any = {"whisker": default_whisker(5.0), "grid_mm": COARSE_MM, "only": FEW}
    loose = identify(scan, PIECE.height_mm, **how)
    shown = Calibration(loose.bench.gain, np.zeros(scan.n_whiskers))
    known = identify(replace(scan, calibration=shown), PIECE.height_mm, **how)
    assert known.before[len(Unknown)] == BENCH_GAIN
    k = list(Unknown).index(Unknown.STIFFNESS)
    # a variance; what the fit's grid does to either is not the gains' fault
    assert known.repeated[k, k] < 0.7 * loose.repeated[k, k]


@given(st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3))
def test_no_step_makes_a_bench_that_there_is_not(sds: list[float]) -> None:
    bench = nominal_bench(default_whisker(5.0), default_touch(5.0), n_whiskers=1)
    before, names = prior_sd(bench), list(Unknown)
    positive = (Unknown.RADIUS, Unknown.FRICTION, Unknown.STIFFNESS)
    step = np.zeros(before.size)
    index = [names.index(name) for name in positive]
    step[index] = np.array(sds) * before[index]
    moved = bench.moved(step)
    assert min(moved[name] for name in positive) >= 0.0
    # what stiffness gains the gain loses
    step[:], stiffness, gain = 0.0, names.index(Unknown.STIFFNESS), len(names)
    step[stiffness], step[gain] = 0.3, -0.3
    moved = bench.moved(step)
    assert moved[Unknown.STIFFNESS] * moved.gain[0] == pytest.approx(1.0)


def test_too_few_passes_are_refused(scan: Scan) -> None:
    one = scan.sweeps[0]
    two = replace(
        one,
        plan=replace(one.plan, line_mm=one.plan.line_mm[:2]),
        moment_n_mm=one.moment_n_mm[:2],
        flags=one.flags[:2],
        air_n_mm=one.air_n_mm[:2],
    )
    with pytest.raises(IdentifyError, match=r"only . passes .*record 6 or more"):
        identify(replace(scan, sweeps=(two,)), PIECE.height_mm, whisker=default_touch(5.0))


def test_a_map_with_holes_is_no_piece() -> None:
    z = np.zeros((40, 40), dtype=np.float32)
    z[3, 4] = np.nan
    with pytest.raises(MapError, match="not measured"):
        heights_of(HeightMap(z, 0.1))


def test_a_bench_goes_through_its_vector() -> None:
    bench = nominal_bench(default_whisker(5.0), default_touch(5.0), n_whiskers=3).with_values(yaw_deg=0.2)
    again = Bench.of_vector(bench.vector())
    assert again.values == bench.values
    np.testing.assert_array_equal(again.gain, bench.gain)
    assert prior_sd(bench).shape == bench.vector().shape
    assert (prior_sd(bench) > 0.0).all()


@pytest.mark.parametrize("kind", list(PieceKind))
def test_pieces_are_level_around_their_relief(kind: PieceKind) -> None:
    piece = Piece(kind)
    z = piece.height_map(0.05).z_mm
    top = piece.depth_mm if kind is PieceKind.BALL else 0.0
    assert z.max() == pytest.approx(top, abs=1e-3)
    assert z.min() == pytest.approx(0.0 if kind is PieceKind.BALL else -piece.depth_mm, abs=1e-6)
    assert np.abs(z[:, 0]).max() == 0.0
    steepest = np.abs(np.diff(z, axis=1)).max() / 0.05
    wall = max(piece.angle_deg) if kind is not PieceKind.STEP else piece.angle_deg[0]
    assert steepest <= np.tan(np.radians(wall)) + 1e-3


# ------------------------------------------------------------------------------------------------------------ traces

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
