"""From nothing to serials: synth, scan, calibrate, read, inspect."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet
import pytest

from tests.contract.front_doors import main, truth_of
from whisker_array import load_scan

pytestmark = pytest.mark.usefixtures("empty_folder")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "parts"
    assert main(["synth", str(folder), "--parts", "2", "--format", "AA99", "--seed", "3"]) == 0
    return folder


@pytest.mark.parametrize("fidelity", ["pointwise", "contact"])
def test_stamped_parts_are_read(fidelity: str, parts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = f"--mode tactile --font gothic --format AA99 --fidelity {fidelity} --jobs 1".split()
    assert main(["read", str(parts), *known, "--truth", str(parts / "truth.csv"), "--out", "t.parquet"]) == 0
    shown = capsys.readouterr().out
    assert "characters 100.00% (0 edits in 8), serials 100.00% (2 of 2)" in shown
    table = pyarrow.parquet.read_table("t.parquet").to_pylist()
    assert [row["part"] for row in table] == ["part-000", "part-001"]
    assert all(row["error"] == "" and row["source"] == "tactile" for row in table)
    assert all(row["height_mm"] == pytest.approx(5.0, rel=0.1) for row in table)


def test_a_part_is_scanned_calibrated_read_and_drawn(parts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = truth_of(parts)
    assert main(["scan", str(parts / "part-000.npz"), "--out", "part-000.h5", "--height-mm", "5"]) == 0
    assert "samples" in capsys.readouterr().out
    scan = load_scan("part-000.h5")
    assert scan.calibration is None
    assert scan.part_id == "part-000"
    assert scan.start_time
    assert main(["calibrate", "part-000.h5"]) == 0
    assert load_scan("part-000.h5").calibration is None
    assert load_scan("part-000-calibrated.h5").calibration is not None
    assert main(["calibrate", "part-000.h5", "--in-place", "--out", "other.h5"]) == 2
    assert main(["calibrate", "part-000.h5", "--in-place"]) == 0
    calibrated = load_scan("part-000.h5").calibration
    assert calibrated is not None
    assert abs(calibrated.gain - 1.0).max() < 0.12
    settings = Path("tactile-marks.toml")
    settings.write_text('font = "gothic"\nformat = "AA99"\nheight_mm = 5.0\n', encoding="utf-8")
    assert main(["read", "part-000.h5", "--out", "t.jsonl"]) == 0
    assert f'"text": "{truth["part-000"]}"' in Path("t.jsonl").read_text(encoding="utf-8")
    assert main(["inspect", "part-000.h5", "--out", "part.png"]) == 0
    assert truth["part-000"] in capsys.readouterr().out
    assert Path("part.png").stat().st_size > 20_000
