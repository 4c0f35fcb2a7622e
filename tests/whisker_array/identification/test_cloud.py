"""Planes through clouds of benches, against models whose planes are known and against the prediction itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.surface.pieces import Piece
from tests.support.benches import recorded
from whisker_array.identification.bench import DRAWN, Bench, Unknown, nominal_bench, prior_sd, screw_slice
from whisker_array.identification.cloud import Plane, plane_through
from whisker_array.identification.forward import Forward
from whisker_array.identification.residuals import sample_sigma_n_mm
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.scan import Scan
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.shapes import TipModel
from whisker_array.whisker.touch import Touch, default_touch

PIECE = Piece(angle_deg=(30.0,), floor_mm=1.0, land_mm=1.5)
SCATTER_N_MM = 0.01
OWN = [i for i, name in enumerate(Unknown) if name not in DRAWN]


@dataclass
class Stub:
    """A forward model: level + slopes of the bench's own numbers, and what jumps where a number passes its start."""

    traces: Sequence[Trace]
    nominal: Touch
    start: Bench
    jump_n_mm: float = 0.0

    def slopes(self, trace: Trace) -> np.ndarray:
        """(samples, own numbers)."""
        return np.random.default_rng(7).normal(size=(trace.measured_n_mm.size, len(OWN)))

    def moments(self, bench: Bench, *, tip: TipModel | None = None) -> list[np.ndarray]:
        off = (bench.vector() - self.start.vector())[OWN]
        # so fast a wave that no plane follows it
        jump = self.jump_n_mm * np.sign(np.sin(1e6 * off.sum()))
        return [1.0 + self.slopes(t) @ off + jump for t in self.traces]


@pytest.fixture(scope="module")
def scan() -> Scan:
    return recorded(PIECE)


def stub(scan: Scan, jump_n_mm: float = 0.0) -> Stub:
    start = nominal_bench(scan.touch, scan.touch, n_whiskers=scan.n_whiskers)
    traces = traces_of(scan, most=4)
    return Stub(traces, scan.touch, start, jump_n_mm)


def laid(model: Stub, *, width: float, turns: int = 1) -> Plane:
    before = prior_sd(model.start)
    free = np.ones(before.size, dtype=np.bool_)
    free[: len(DRAWN)] = False
    # narrow: tips and friction become less in proportion
    cloud = np.diag((width * before) ** 2)
    return plane_through(
        cast(Forward, model),
        model.start,
        cloud,
        free=free,
        scatter_n_mm=SCATTER_N_MM,
        cautious=True,
        turns=turns,
        seed=(3, 0),
    )


def test_a_plane_is_laid_through_what_is_plane(scan: Scan) -> None:
    """No error but that of proportions, second order in a width of 1e-4: below 1e-3 of a slope."""
    model = stub(scan)
    plane = laid(model, width=1e-4)
    for trace, moment, by, sigma in zip(model.traces, plane.moment, plane.jacobian, plane.sigma, strict=True):
        felt = ~np.isnan(trace.measured_n_mm)
        np.testing.assert_allclose(moment, 1.0, atol=1e-6)
        np.testing.assert_allclose(by[felt][:, OWN], model.slopes(trace)[felt], atol=1e-3)
        np.testing.assert_allclose(sigma, sample_sigma_n_mm(trace, SCATTER_N_MM), rtol=1e-6)
        assert not by[~felt].any()


def test_what_jumps_within_the_cloud_is_roughness(scan: Scan) -> None:
    """The sign of a fast wave scatters by its size; 288 points tell that within a tenth."""
    model = stub(scan, jump_n_mm=0.2)
    plane = laid(model, width=0.01, turns=16)
    rough = []
    for trace, sigma in zip(model.traces, plane.sigma, strict=True):
        felt = ~np.isnan(trace.measured_n_mm)
        of_sample = sample_sigma_n_mm(trace, SCATTER_N_MM)
        rough.append(np.sqrt(sigma[felt] ** 2 - of_sample[felt] ** 2))
    assert np.median(np.concatenate(rough)) == pytest.approx(0.2, rel=0.1)


def test_a_screw_that_is_ahead_is_a_piece_that_lies_behind(scan: Scan) -> None:
    """The tangent is the piece's shift, the prediction another place: alike within a fifth, for walls have kinks;
    a line along a groove feels nothing of it but the rounding of maps."""
    about = nominal_bench(scan.touch, scan.touch, n_whiskers=scan.n_whiskers)
    traces = traces_of(scan, most=16)
    forward = Forward(
        PIECE.height_mm, traces, nominal=scan.touch, about=about, setup_friction=scan.touch.friction,
        grid_mm=0.0125,
    )  # fmt: skip
    before = prior_sd(about)
    free = np.ones(before.size, dtype=np.bool_)
    free[: len(DRAWN)] = False
    plane = plane_through(
        forward,
        about,
        np.diag((0.03 * before) ** 2),
        free=free,
        scatter_n_mm=SCATTER_N_MM,
        cautious=True,
        turns=2,
        seed=(1, 0),
    )
    for along_x in (True, False):
        mine = screw_slice(before.size, along_x=along_x)
        step = np.zeros(before.size)
        step[mine] = 0.3 * before[mine]
        told_of_any = 0.0
        behind, ahead = (forward.moments(Bench.of_vector(about.vector() + way * step)) for way in (-1.0, 1.0))
        for trace, was, then, by in zip(traces, behind, ahead, plane.jacobian, strict=True):
            if trace.plan.direction.along_x is along_x:
                told = 2.0 * by @ step
                told_of_any += np.std(told)
                assert np.std(then - was - told) <= 0.2 * np.std(told) + 1e-5
            else:
                np.testing.assert_array_equal(then, was)
        assert told_of_any > 0.0


@given(st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3))
def test_no_step_makes_a_bench_that_there_is_not(sds: list[float]) -> None:
    bench = nominal_bench(default_whisker(5.0), default_touch(5.0), n_whiskers=1)
    before, names = prior_sd(bench), list(Unknown)
    step = np.zeros(before.size)
    at = [names.index(name) for name in (Unknown.RADIUS, Unknown.FRICTION, Unknown.STIFFNESS)]
    step[at] = np.array(sds) * before[at]
    there = bench.moved(step)
    assert min(there[name] for name in (Unknown.RADIUS, Unknown.FRICTION, Unknown.STIFFNESS)) >= 0.0
    # what stiffness gains the gain loses
    step[:], stiffness, gain = 0.0, names.index(Unknown.STIFFNESS), len(names)
    step[stiffness], step[gain] = 0.3, -0.3
    moved = bench.moved(step)
    assert moved[Unknown.STIFFNESS] * moved.gain[0] == pytest.approx(1.0)
