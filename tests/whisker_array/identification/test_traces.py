"""Which lines of a recording are fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.surface.pieces import Piece, PieceKind
from tests.support.benches import recorded
from whisker_array.identification.traces import Trace, traces_of
from whisker_array.scan.scan import Scan


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
