"""The accepted risk: from a flag, the file, the environment and Python, and one that no sense keeps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from glyphs import MarksError, stamp
from pipeline import SettingsError, read
from recognition import Reader, ReaderSettings
from tests.contract.front_doors import Command

pytestmark = pytest.mark.usefixtures("empty_folder")

FACTS = {"fonts": "gothic", "format": "A9", "height_mm": 4.0}


def row(command: Command, height_map: Path, *flags: str) -> dict[str, Any]:
    facts = ("--font", "gothic", "--format", "A9", "--height-mm", "4", "--out", "t.jsonl", "--force")
    ended = command("read", height_map, *facts, *flags)
    assert ended.status == 0, ended.err
    (line,) = Path("t.jsonl").read_text(encoding="utf-8").splitlines()
    found: dict[str, Any] = json.loads(line)
    return found


def test_one_in_a_thousand_is_accepted_unless_another_risk_is_set(
    command: Command, height_map: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = row(command, height_map)
    assert (usual["text"], usual["decision"], usual["accept_risk"]) == ("K7", "accept", 0.001)
    Path("tactile-marks.toml").write_text('accept_risk = "1 in 50"\n', encoding="utf-8")
    assert row(command, height_map)["accept_risk"] == 0.02
    monkeypatch.setenv("TACTILE_MARKS_ACCEPT_RISK", "1/20")
    assert row(command, height_map)["accept_risk"] == 0.05
    flagged = row(command, height_map, "--accept-risk", "1 in 1000")
    besides = {"at": 0, "seconds": 0, "settings": "with a risk that is set"}
    assert {**flagged, **besides} == {**usual, **besides}


def test_python_takes_the_same_risk(height_map: Path) -> None:
    reading = read(height_map, accept_risk="1 in 100", **FACTS)
    assert (reading.text, reading.decision, reading.accept_risk) == ("K7", "accept", 0.01)
    assert reading.threshold is not None
    assert reading.confidence >= reading.threshold
    lenient = Reader(accept_risk=0.05, **FACTS).read(stamp("K7", fonts="gothic", height_mm=4.0, seed=3))  # type: ignore[arg-type]
    assert lenient.accept_risk == 0.05
    assert lenient.threshold is not None
    assert lenient.threshold < reading.threshold
    assert ReaderSettings().risk_of("tactile") == ReaderSettings().risk_of("fused") == 0.001


def test_a_risk_that_no_sense_keeps_is_refused_before_anything_is_read(
    command: Command, height_map: Path
) -> None:
    ended = command("read", height_map, "--accept-risk", "1 in 100,000,000", "--out", "t.jsonl")
    assert ended.status == 2
    assert "no sense can promise 1 in 100,000,000; allow 1 in " in ended.err
    assert len(ended.err.splitlines()) == 1
    assert not Path("t.jsonl").exists()
    served = command("serve", "--accept-risk", "1 in 100,000,000", "--tokens", "off", "--port", "0")
    assert (served.status, served.err) == (2, ended.err)
    with pytest.raises(MarksError, match="no sense can promise"):
        read(height_map, accept_risk=1e-8)


@pytest.mark.parametrize("risk", ["often", "0", "1", "1 in 0"])
def test_what_is_no_risk_is_refused_with_an_example(command: Command, height_map: Path, risk: str) -> None:
    ended = command("read", height_map, "--accept-risk", risk)
    assert ended.status == 2
    assert "write a risk between 0 and 1, such as 0.001, 1/1000 or 1 in 1000" in ended.err


def test_the_old_setting_is_refused_with_the_new_name(command: Command, height_map: Path) -> None:
    Path("tactile-marks.toml").write_text("accept_confidence = 0.97\n", encoding="utf-8")
    ended = command("read", height_map)
    assert ended.status == 2
    assert "unknown setting accept_confidence in tactile-marks.toml; did you mean accept_risk?" in ended.err
    Path("tactile-marks.toml").unlink()
    assert "Did you mean --accept-risk?" in command("read", height_map, "--accept-confidence", "0.97").err
    with pytest.raises(SettingsError, match="did you mean accept_risk"):
        read(height_map, accept_confidence=0.97)
