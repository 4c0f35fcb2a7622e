"""Depth from a file to the table and the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs import stamp
from glyphs.stamping.variation import StampingVariation
from pipeline.cli.main import main
from pipeline.formats.npz import write_npz
from tests.support.run_tables import csv_rows

pytestmark = pytest.mark.usefixtures("inline")
KNOWN = ("--font", "gothic", "--height-mm", "5", "--format", "A9A9", "--experts", "network")
"""How the part is soonest read: its text is not the question here."""


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    stamped = stamp("K7B1", depth_mm=0.15, pitch_mm=0.08, variation=StampingVariation.none(), seed=1)
    path = tmp_path_factory.mktemp("parts") / "one.npz"
    write_npz(path, stamped.height_map)
    return path


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_table_tells_depths_and_what_is_too_shallow(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rules = ("--depth-rule", "27CFR478.92", "--depth-rule", "0.2:")
    assert main(["read", str(part), *KNOWN, "--out", "t.csv", *rules]) == 0
    (row,) = csv_rows("t.csv")
    assert row["text"] == "K7B1"
    # read for sure, but not as deep as was asked for
    assert row["decision"] == "review"
    assert float(row["confidence"]) > 0.9
    # the die is 0.15 mm deep; a flat floor is felt some micrometres too deep
    assert float(row["depth_min_mm"]) == pytest.approx(0.15, abs=0.008)
    assert float(row["depth_min_mm"]) <= float(row["depth_mean_mm"])
    told = row["depths"].split()
    assert told[::2] == ["K", "7", "B", "1"]
    assert all(float(least) <= float(mean) for least, mean in (pair.split("/") for pair in told[1::2]))
    assert row["flags"].startswith("too shallow for own rule: K at place 1 0.1")
    assert row["flags"].endswith("(at least 0.2)")
    printed = capsys.readouterr().out
    assert "depth" in printed
    assert "too shallow for own rule" in printed
    assert "27CFR478.92" not in printed


def test_inspect_says_what_is_too_shallow(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("job.toml").write_text('depth_rule = "0.2:"\nexperts = "network"\n', encoding="utf-8")
    options = (*KNOWN[:6], "--job", "job.toml", "--out", "a.png")
    assert main(["inspect", str(part), *options]) == 0
    printed = capsys.readouterr().out
    assert "shallowest mark 0." in printed
    assert "too shallow for own rule" in printed
    assert Path("a.png").is_file()
