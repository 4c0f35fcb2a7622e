"""`identify` as a user runs it: a piece, its scan, the whisker as drawn and as found."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.contract.front_doors import main

DRAWN = """
format_version = 1
kind = "L"
l1_mm = 30.0
l2_mm = 3.51
l3_mm = 3.51
beta_deg = 0.0
preload_mm = 1.0
tip_radius_mm = 0.06
friction = 0.2
character_height_mm = 5.0
line_pitch_mm = 0.125
sample_pitch_mm = 0.03125
speed_mm_s = 50.0
material = "music wire"
[section]
kind = "ribbon"
thickness_mm = 0.3
width_mm = 4.5
"""


def test_a_whisker_is_identified_and_scanned_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("piece.toml").write_text('kind = "pits"\nangle_deg = [45]\nfloor_mm = 0.6\nland_mm = 1.2\n')
    Path("drawn.toml").write_text(DRAWN)
    scan = ["scan", "piece.toml", "--out", "piece.h5", "--height-mm", "5", "--friction", "0.3"]
    assert main(scan) == 0
    capsys.readouterr()
    found = ["identify", "piece.h5", "--piece", "piece.toml"]
    assert main([*found, "--whisker", "drawn.toml", "--out", "found.toml", "--figure", "found.svg"]) == 0
    said = capsys.readouterr().out
    friction = next(line.split() for line in said.splitlines() if line.startswith("friction"))
    assert float(friction[1]) == pytest.approx(0.3, abs=0.03)
    assert float(friction[3]) == 0.2
    assert "known only together: stiffness, gains" in said
    assert "<svg" in Path("found.svg").read_text()
    found_friction = tomllib.loads(Path("found.toml").read_text())["friction"]
    assert found_friction == pytest.approx(float(friction[1]), rel=1e-3)
    capsys.readouterr()
    assert main(["scan", "piece.toml", "--out", "again.h5", "--whisker", "found.toml"]) == 0
    promised = capsys.readouterr().out.splitlines()
    assert promised[-5].startswith("moment of the land, N mm")
    assert "+-" in promised[-1]
    job = ["design", "--height-mm", "5", "--alpha", "20:45", "--mu", "0.1:0.3", "--depth-mm", "0.3"]
    assert main([*job, "--whisker", "found.toml"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[:6] == promised[-6:]
    assert told[6].startswith("worst edge contrast")
    assert main([*job, "--whisker", "drawn.toml"]) == 1
    assert "let identify --out write it" in capsys.readouterr().err
    assert main([*job, "--whisker", "found.toml", "--out", "other.toml"]) == 2
    assert "leave out --out" in capsys.readouterr().err
    assert main([*found, "--out", "found.toml"]) == 2
    assert "add --whisker" in capsys.readouterr().err
    assert main(["identify", "piece.toml", "--piece", "piece.toml"]) == 1
    assert "piece.toml" in capsys.readouterr().err
