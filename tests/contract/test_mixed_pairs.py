"""The photograph of one part beside the height map of another: never accepted, wherever both are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from glyphs import stamp
from recognition import Reader
from tests.contract.front_doors import main, truth_of

pytestmark = pytest.mark.usefixtures("empty_folder")


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two parts of a lot whose photographs have been exchanged."""
    folder = tmp_path_factory.mktemp("made") / "mixed"
    assert main(["synth", str(folder), "--parts", "2", "--format", "A9", "--seed", "5", "--dirt", "0"]) == 0
    first, second = (folder / f"part-00{k}.png" for k in (0, 1))
    first.rename(folder / "aside")
    second.rename(first)
    (folder / "aside").rename(second)
    return folder


@pytest.mark.parametrize("mode", [["--mode", "fused"], ["--mode", "auto", "--active"]])
def test_a_run_sends_both_to_review(mixed: Path, mode: list[str]) -> None:
    assert main(["read", str(mixed), "--format", "A9", *mode, "--out", "t.jsonl", "--jobs", "1"]) == 0
    lines = Path("t.jsonl").read_text(encoding="utf-8").splitlines()
    rows: dict[str, Any] = {row["part"]: row for row in map(json.loads, lines)}
    truth = truth_of(mixed)
    for part, other in (("part-000", "part-001"), ("part-001", "part-000")):
        row = rows[part]
        assert (row["text"], row["decision"], row["source"]) == (truth[part], "review", "fused")
        apart = f"camera reads {truth[other]}, touch {truth[part]}: are they of one part?"
        assert row["messages"][0] == apart
        assert row["reasons"][0]["code"] == "senses_disagree"
        assert row["reasons"][0]["places"]


def test_python_does_not_accept_them_either() -> None:
    """Nor if the serials have different numbers of characters."""
    felt, seen = (stamp(text, height_mm=4.0, seed=4) for text in ("KX40", "KX4725"))
    reader = Reader()
    reading = reader.read(felt.height_map, seen.photograph())
    assert (reading.text, reading.decision.value) == ("KX40", "review")
    assert reading.messages()[0] == "camera reads KX4725, touch KX40: are they of one part?"
    # without a format, O and 0 are too much alike
    assert Reader(format="AA99").read(felt.height_map, felt.photograph()).decision.value == "accept"
