"""`read --active`, `scan --active` and `benchmark --active` from the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs import stamp
from pipeline.cli.main import main
from pipeline.formats.npz import write_npz
from tests.support.csv_table import csv_rows
from whisker_array.whisker.array import LINES_PER_HEIGHT

pytestmark = pytest.mark.usefixtures("inline")


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("parts") / "part.npz"
    write_npz(path, stamp("KX40", fonts="gothic", height_mm=5.0, seed=3).height_map)
    return path


def test_read_tells_what_the_serial_cost(
    part: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "read.csv"
    assert main(["read", str(part), "--format", "AA99", "--active", "--out", str(out)]) == 0
    (row,) = csv_rows(out)
    assert (row["text"], row["decision"]) == ("KX40", "accept")
    assert "s of stage time: the serial is sure" in row["flags"]


def test_an_active_scan_chooses_its_ways_itself(part: Path, tmp_path: Path) -> None:
    asked = ("scan", str(part), "--out", str(tmp_path / "felt.h5"), "--height-mm", "5", "--active")
    assert main([*asked, "--format", "AA99", "--two-way"]) == 2


def test_the_benchmark_compares_plans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.benchmark.readers import modes
    from pipeline.benchmark.readers import plans as touch_plans

    # three plans of all: the suite need not feel a part as often
    plans = (
        touch_plans.TouchPlan("active", 100.0),
        touch_plans.TouchPlan("uniform", 4),
        touch_plans.TouchPlan("whole", LINES_PER_HEIGHT),
    )
    monkeypatch.setattr(modes, "PLANS", plans)
    asked = f"benchmark run --mode plans --out {tmp_path} --dirt 0 --parts 1 --format AA99".split()
    assert main(asked) == 0
    rows = csv_rows(tmp_path / "benchmark.csv")
    assert [row["mode"] for row in rows] == [plan.mode for plan in plans]
    assert all(row["text"] == row["truth"] and float(row["scan_s"]) > 0.0 for row in rows)
    assert "mean scan by a stage" in capsys.readouterr().out
