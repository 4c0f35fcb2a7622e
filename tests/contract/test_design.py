"""`design` as an engineer uses it, and `scan` with what it wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.contract.front_doors import main
from whisker_array import load_scan, moment_ratio

ASKED = [
    "--alpha",
    "30:60",
    "--mu",
    "0.1:0.5",
    "--depth-mm",
    "0.2",
    "--height-mm",
    "5",
    "--no-trade-offs",
]


def test_what_is_designed_is_written_drawn_and_scanned_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = tmp_path / "w.toml", tmp_path / "w.png"
    assert main(["design", *ASKED, "--out", str(out), "--picture", str(picture)]) == 0
    told = capsys.readouterr().out
    for word in ("build", "worst edge contrast", "binds", "linear beam", "first frequency"):
        assert word in told
    assert picture.stat().st_size > 20_000
    part, scan = tmp_path / "plate.npz", tmp_path / "plate.h5"
    z = np.zeros((120, 160), dtype=np.float32)
    z[40:80, 70:90] = -0.2
    np.savez(part, z_mm=z, pitch_mm=0.1)
    assert (
        main(["scan", str(part), "--out", str(scan), "--whisker", str(out), "--profilers", "--two-way"]) == 0
    )
    scanned = load_scan(scan)
    assert len(scanned.touches) == 2
    assert any(sweep.plan.pushed for sweep in scanned.sweeps)
    # the two ends of the range, as eq. (16) has them: clearly edges, and no jam
    ratio = moment_ratio(np.tan(np.radians([-60.0, -30.0, 30.0, 60.0])), 0.1, scanned.touch.tip)
    assert np.isfinite(ratio).all()
    assert (np.abs(ratio - 1.0) > 0.1).all()


@pytest.mark.parametrize(
    "change",
    [
        ("--alpha", "60:30"),
        ("--alpha", "steep"),
        ("--mu", "0.5:0.1"),
        ("--depth-mm", "-1"),
        ("--height-mm", "nan"),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(
    change: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    asked = list(ASKED)
    asked[asked.index(change[0]) + 1] = change[1]
    assert main(["design", *asked]) == 2
    said = capsys.readouterr().err
    assert said.startswith("tactile-marks: ")
    assert change[1].split(":")[0] in said
