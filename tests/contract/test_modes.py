"""One dirty part with its photograph, read by touch, by sight, by both, and held against what it should read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.contract.front_doors import main, truth_of

pytestmark = pytest.mark.usefixtures("empty_folder")

FORMAT = "A9"


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "parts"
    made = ["synth", str(folder), "--parts", "1", "--format", FORMAT, "--seed", "11", "--dirt", "0.2"]
    assert main(made) == 0
    assert sorted(p.name for p in folder.iterdir()) == ["part-000.npz", "part-000.png", "truth.csv"]
    return folder


def read(parts: Path, *more: str) -> tuple[int, dict[str, Any]]:
    told = ["--font", "gothic", "--format", FORMAT, "--height-mm", "5", "--out", "t.jsonl", "--force"]
    status = main(["read", str(parts), *told, *more])
    (line,) = Path("t.jsonl").read_text(encoding="utf-8").splitlines()
    return status, json.loads(line)


def test_a_dirty_part_in_every_mode(parts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (truth,) = truth_of(parts).values()
    status, row = read(parts, "--truth", str(parts / "truth.csv"))
    assert (status, row["text"], row["source"]) == (0, truth, "fused")
    assert "serials 100.00% (1 of 1)" in capsys.readouterr().out
    # touch grades the mark, a letter a character
    status, row = read(parts, "--mode", "tactile", "--verify", str(parts / "truth.csv"))
    assert (status, row["text"], row["source"], row["verdict"]) == (0, truth, "tactile", "confirmed")
    assert [c["char"] for c in row["characters"]] == list(truth)
    assert all(c["grade"] in "ABCDF" for c in row["characters"])
    wrong = ("B" if truth[0] != "B" else "K") + truth[1:]
    status, row = read(parts, "--mode", "tactile", "--verify", wrong)
    assert (status, row["verdict"], row["expected"]) == (1, "refuted", wrong)
    first = row["characters"][0]
    assert (first["state"], first["state_chars"]) == ("mismatch", [truth[0], wrong[0]])
    assert any("this is not the expected serial" in said for said in row["messages"])


def test_a_part_under_several_lights(tmp_path: Path) -> None:
    made = f"--parts 2 --format {FORMAT} --seed 11 --dirt 0 --lights 3".split()
    assert main(["synth", "lit", *made]) == 0
    lit = Path("lit")
    assert len(list(lit.glob("part-00?.light-[123].png"))) == 6
    (lit / "part-001.light-2.png").write_bytes(b"no picture")
    told = f"--mode vision --format {FORMAT} --font gothic --truth lit/truth.csv --jobs 1".split()
    assert main(["read", "lit", *told, "--out", "t.jsonl"]) == 0
    lines = Path("t.jsonl").read_text(encoding="utf-8").splitlines()
    rows = {row["part"]: row for row in map(json.loads, lines)}
    assert {part: row["text"] for part, row in rows.items()} == truth_of(lit)
    assert [rows[part]["photos"] for part in ("part-000", "part-001")] == [3, 2]
    assert not any("photograph" in said for said in rows["part-000"]["messages"])
    assert any("light-2.png: is not a picture" in said for said in rows["part-001"]["messages"])
