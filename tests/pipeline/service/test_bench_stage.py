"""A bench of iron as the service's stage: the frame of the photograph, and the whole plan."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.reading_records import ScanPlanRecord
from pipeline.service.stage import ScanOrder, StageError
from pipeline.service.stage.devices import BenchStage
from tests.support.bench import HEIGHT_MM, a_pass, bench_settings, stamped
from tests.support.emulator.bench import EmulatedBench
from tests.support.scans import feel_plan
from whisker_array.scan.recording import load_scan


def order(region_mm: tuple[float, float, float, float]) -> ScanOrder:
    """Of a photograph whose middle is its (20, 10), taken over the middle of the field, (7, 5)."""
    return ScanOrder(
        "plate 7",
        ScanPlanRecord(
            region_mm=region_mm, directions_deg=(0,), passes=1, line_pitch_mm=0.075, sample_pitch_mm=0.0375,
            speed_mm_s=40.0, preload_mm=0.6, seconds=9.0, height_mm=HEIGHT_MM, reason="to try it",
            middle_mm=(20.0, 10.0),
        ),
    )  # fmt: skip


def test_the_service_feels_in_the_photographs_frame(tmp_path: Path) -> None:
    with EmulatedBench(stamped(), bench_settings(), seed=1) as emulated:
        stage = BenchStage(emulated.settings)
        session = stage.open(order((14.0, 6.0, 30.0, 14.0)))
        # the region, as far as the field reaches: its right end lies at 7 + (30 - 20) = 17 of 14 mm
        assert session.fitting.field_mm == (14.0, 6.0, 27.0, 14.0)
        # 13 mm right and 5 mm below: the same place of the plate
        sweep = session.feel(a_pass(at_mm=(19.0, 10.0)))
        assert not sweep.flags.any()
        assert sweep.plan.line_mm[0].tolist() == [7.0, 10.0, 13.0]
        assert (
            emulated.world.place_mm["X"] > 30.0 + 9.0 - 2.0
        )  # 9 mm on the plate, the tip 2 mm ahead of its axis
        session.close()
        with pytest.raises(StageError, match="no longer on the stage"):
            session.feel(a_pass())
        with pytest.raises(StageError, match="not on the field"):
            stage.open(order((40.0, 6.0, 60.0, 14.0)))
        scan = load_scan(feel_plan(stage, order((16.0, 8.0, 20.0, 11.5)), tmp_path))
        assert scan.part_id == "plate 7"
        assert scan.sweeps[0].plan.line_mm.min() == 8.0
