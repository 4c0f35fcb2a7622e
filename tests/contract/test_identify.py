"""A whisker that `identify` has found: scanned and designed with, and the errors of `identify`.

The fit itself is run by the bench guide's test and by the tests of `whisker_array/identification`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contract.front_doors import ROOT, Command

FOUND = ROOT / "tests" / "data" / "whiskers" / "identified.toml"
JOB = ("design", "--height-mm", "5", "--alpha", "20:45", "--mu", "0.1:0.3", "--depth-mm", "0.3")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("piece.toml").write_text('kind = "pits"\nangle_deg = [45]\nfloor_mm = 0.6\nland_mm = 1.2\n')


def test_what_is_known_of_a_whisker_is_shown_by_scan_and_design(command: Command) -> None:
    scanned = command("scan", "piece.toml", "--out", "again.h5", "--whisker", FOUND)
    assert scanned.status == 0
    promised = scanned.out.splitlines()
    assert promised[-5].startswith("moment of the land, N mm")
    assert "+-" in promised[-1]
    designed = command(*JOB, "--whisker", FOUND)
    assert designed.status == 0
    lines = designed.out.splitlines()
    assert lines[:6] == promised[-6:]
    assert lines[6].startswith("worst edge contrast")


def test_design_judges_a_whisker_that_was_not_identified(command: Command) -> None:
    Path("drawn.toml").write_text(FOUND.read_text().partition("[identified]")[0])
    judged = command(*JOB, "--whisker", "drawn.toml")
    assert judged.status == 0
    assert "worst edge contrast" in judged.out


def test_what_identify_and_design_refuse(command: Command) -> None:
    refused = command(*JOB, "--whisker", FOUND, "--out", "other.toml")
    assert refused.status == 2
    assert "leave out --out" in refused.err
    refused = command("identify", "piece.h5", "--piece", "piece.toml", "--out", "found.toml")
    assert refused.status == 2
    assert "add --whisker" in refused.err
    refused = command("identify", "piece.toml", "--piece", "piece.toml")
    assert refused.status == 1
    assert "piece.toml" in refused.err
