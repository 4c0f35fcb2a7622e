"""Scans, plans and stages for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.bench.bench import feel_all, raster_passes
from pipeline.service.stage import ScanOrder
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.recording import save_scan
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import SessionStage, StageSession
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass

# ------------------------------------------------------------------------------------------------------------- scans

SMALL_PLAN = RasterPlan(
    array=WhiskerArray(4, 1.0),
    region_mm=(0.0, 0.0, 6.0, 4.0),
    line_pitch_mm=0.25,
    sample_pitch_mm=0.05,
    lead_mm=0.5,
    air_samples=6,
)
"""Of a plate of 6 x 4 mm."""
ROUGH_PLAN = RasterPlan(
    array=WhiskerArray(3, 0.5),
    region_mm=(0.5, 0.5, 6.0, 3.0),
    line_pitch_mm=0.25,
    sample_pitch_mm=0.1,
    directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_Y),
    lead_mm=0.7,
    air_samples=5,
)
"""Of `rough_plate`."""


def rough_plate(rng: np.random.Generator) -> HeightMap:
    """Noise of 2 um, on 7.2 x 3.6 mm."""
    return HeightMap(rng.normal(0.0, 0.002, (60, 120)).astype(np.float32), 0.06)


def feel_plan(stage: SessionStage[ScanOrder], order: ScanOrder, into: Path) -> Path:
    """A recording of the whole plan, pass by pass in the default raster."""
    session = stage.open(order)
    try:
        ways = [TraceDirection(d) for d in order.plan.directions_deg]
        scan = feel_all(session, raster_passes(session.fitting, session.fitting.field_mm, ways))
    finally:
        session.close()
    save_scan(scan, into / "scan.h5")
    return into / "scan.h5"


def _assert_arrays(one: object, other: object, *names: str) -> None:
    for name in names:
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_array_equal(a, b, err_msg=name)
        assert np.asarray(a).dtype == np.asarray(b).dtype, name


def _assert_values(one: object, other: object, *names: str) -> None:
    for name in names:
        assert getattr(one, name) == getattr(other, name), name


def assert_same_calibration(one: Calibration | None, other: Calibration | None) -> None:
    """Gains, offsets and where they are from are alike."""
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        _assert_arrays(one, other, "gain", "offset_n_mm")
        _assert_values(one, other, "from_land")


def assert_same_scan(one: Scan, other: Scan) -> None:
    """Sweeps, touches, calibration and what was noted are alike, to the last bit."""
    for a, b in zip(one.sweeps, other.sweeps, strict=True):
        _assert_values(a.plan, b.plan, "direction", "pushed", "start_mm", "step_mm", "n_samples", "n_lead")
        _assert_arrays(a.plan, b.plan, "line_mm")
        _assert_arrays(a, b, "moment_n_mm", "flags", "air_n_mm")
    for c, d in zip(one.touches, other.touches, strict=True):
        _assert_arrays(c.tip, d.tip, "compliance_mm_per_n", "moment_arm_mm")
        _assert_values(c, d, "preload_mm", "tip_radius_mm", "friction", "whisker")
    noted = ("kind", "line_pitch_mm", "sample_rate_hz", "part_id", "start_time", "fidelity", "notes")
    _assert_values(one, other, *noted)
    assert_same_calibration(one.calibration, other.calibration)


# ----------------------------------------------------------------------------------------------------------- jamming


class Jamming:
    """A session that fails after so many passes, if it does.

    Attributes:
        felt: passes so far.
        closed: how often it was closed.
    """

    def __init__(
        self, within: StageSession, after: int | None = None, fault: type[Exception] = StageError
    ) -> None:
        self._within, self._after, self._fault, self.fitting = within, after, fault, within.fitting
        self.felt = self.closed = 0

    def feel(self, order: Pass) -> Sweep:
        if self.felt == self._after:
            raise self._fault("the array has jammed")
        self.felt += 1
        return self._within.feel(order)

    def close(self) -> None:
        self.closed += 1
        self._within.close()
