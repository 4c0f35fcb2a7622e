"""A bench identified from what MuJoCo makes of drags over wedges: another's solver, friction and preload hidden."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("mujoco", reason="an independent contact solver: pip install 'tactile-marks[proof]'")

from glyphs.surface.maps import TraceDirection
from tests.support.mujoco_whisker import Wedge, drag
from whisker_array.identification.bench import Unknown
from whisker_array.identification.fit import identify
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

WHISKER = LShaped(300.0, 300.0 * 0.117, None, 0.0, Round(4.0))
"""Ten times as large as whiskers are, so that what a stage's place may be off is next to nothing."""
PRELOAD_MM, FRICTION, GAIN = 2.5, 0.27, 1.02
SLOPES_DEG = (-45.0, -30.0, 20.0, 30.0)
NOMINAL = Touch(WHISKER.tip_model(), preload_mm=2.6, tip_radius_mm=0.125, friction=0.2)
LEAD_MM, APART_MM, EVERY = 2.5, 5.0, 20
"""Land before each seam, distance of the lines, and readings for one sample: 0.05 mm."""
PASSES = 12
"""Over all wedges, a whisker over each, with noise of their own."""


def height_mm(x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """A wedge beside the other, each where its line runs."""
    wedge = np.clip(np.rint(y_mm / APART_MM), 0, len(SLOPES_DEG) - 1).astype(np.intp)
    slope = np.tan(np.radians(np.array(SLOPES_DEG)))[wedge]
    return np.asarray(slope * np.maximum(x_mm, 0.0))


def test_friction_and_preload_are_found_in_anothers_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction within the 0.01 that is asked; preload within 2 %, twice what large rotation is worth."""
    monkeypatch.setattr("tests.support.mujoco_whisker.LINKS_MM", 20.0)  # as many links as elsewhere
    rng = np.random.default_rng(0)
    rows = []
    for degrees in SLOPES_DEG:
        slope = math.tan(math.radians(degrees))
        run = drag(
            WHISKER, Wedge(slope, FRICTION), preload_mm=PRELOAD_MM, start_mm=-LEAD_MM,
            travel_mm=LEAD_MM + 1.4, radius_mm=NOMINAL.tip_radius_mm,
        )  # fmt: skip
        # a tip set down at rest slides steadily after a third of the land
        begun = run.free_tip_x_mm.size // 4
        rows.append((run.free_tip_x_mm[begun::EVERY], run.moment_n_mm[begun::EVERY]))
    n = min(at.size for at, _ in rows)
    at = rows[0][0][:n]
    # positions are told as those of the tip on the land, at the friction that the stage was set up for
    start = float(at[0]) + land_lag_mm(NOMINAL.tip, preload_mm=NOMINAL.preload_mm, friction=NOMINAL.friction)
    moment = GAIN * np.repeat(np.array([m[:n] for _, m in rows])[None], PASSES, axis=0)
    moment = moment + 0.001 * abs(NOMINAL.land_moment_n_mm()) * rng.standard_normal(moment.shape)
    lines = np.repeat(APART_MM * np.arange(len(SLOPES_DEG))[None], PASSES, axis=0)
    plan = SweepPlan(TraceDirection.FORWARD_X, lines, start, float(at[1] - at[0]), n, 0)
    sweep = Sweep(
        plan, moment.astype(np.float32), np.zeros(moment.shape, dtype=np.uint8),
        np.zeros((*moment.shape[:2], 0), dtype=np.float32),
    )  # fmt: skip
    scan = Scan((sweep,), NOMINAL, line_pitch_mm=APART_MM, sample_rate_hz=1000.0)
    found = identify(
        scan,
        height_mm,
        whisker=NOMINAL,
        only=(Unknown.FRICTION, Unknown.PRELOAD, Unknown.SHIFT_X),
        grid_mm=0.02,
    )
    assert found.of(Unknown.FRICTION)[0] == pytest.approx(FRICTION, abs=0.01)
    assert found.of(Unknown.PRELOAD)[0] == pytest.approx(PRELOAD_MM, rel=0.02)
    # gain and preload share the moment on the land, which is known better than either
    assert float(found.bench.gain.mean()) == pytest.approx(GAIN, rel=0.02)
    land = float(found.bench.gain.mean()) * found.of(Unknown.PRELOAD)[0]
    assert land == pytest.approx(GAIN * PRELOAD_MM, rel=0.005)
