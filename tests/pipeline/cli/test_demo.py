"""The demonstration: every part is read as stamped, and drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.demo import PLATES
from pipeline.cli.main import main


def test_the_demonstration_reads_every_plate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert str(out / "overview.png") in shown
    assert all(plate["text"] in shown for plate in PLATES.values())
    assert {p.suffix for p in out.iterdir()} == {".npz", ".h5", ".png"}
