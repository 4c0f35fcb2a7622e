"""What numbers do to a prediction, against the prediction itself."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.surface.pieces import Piece
from tests.support.benches import recorded
from whisker_array.identification.bench import Bench, known_before, nominal_bench, of_screw
from whisker_array.identification.forward import Forward
from whisker_array.identification.tangents import jacobian_of
from whisker_array.identification.traces import traces_of

PIECE = Piece(angle_deg=(30.0,), floor_mm=1.0, land_mm=1.5)


@pytest.mark.parametrize("along_x", [True, False])
def test_a_screw_that_is_ahead_is_a_piece_that_lies_behind(along_x: bool) -> None:
    """The tangent is the piece's shift, the prediction another place: alike within a fifth: walls have kinks."""
    scan = recorded(PIECE)
    about = nominal_bench(scan.touch, scan.touch, n_whiskers=scan.n_whiskers)
    traces = traces_of(scan, about=about, largest_n_mm=1e3, most=16)
    forward = Forward(
        PIECE.height_mm, traces, nominal=scan.touch, about=about, setup_friction=scan.touch.friction,
        largest_n_mm=1e3, grid_mm=0.0125,
    )  # fmt: skip
    before = known_before(about)
    free = np.ones(before.size, dtype=np.bool_)
    here = forward.moments(about)
    sigma = [np.ones_like(p) for p in here]
    tangents = jacobian_of(forward, about, before, free, here, sigma, reach=0.03)
    mine = of_screw(before.size, along_x=along_x)
    step = np.zeros(before.size)
    step[mine] = 0.3 * before[mine]
    there = forward.moments(Bench.of_vector(about.vector() + step))
    told_of_any = 0.0
    for trace, was, then, tangent in zip(traces, here, there, tangents, strict=True):
        if trace.plan.direction.along_x is along_x:
            told = tangent @ step
            told_of_any += np.std(told)
            assert np.std(then - was - told) <= 0.2 * np.std(told) + 1e-6
        else:
            np.testing.assert_array_equal(then, was)
    assert told_of_any > 0.0
