"""Parts from nothing to serials: stamped, scanned, calibrated and read by touch, by sight and by both."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from PIL import Image

from glyphs import stamp
from recognition import Reader
from tests.contract.front_doors import Command, main, truth_of
from whisker_array import load_scan

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


@pytest.fixture(scope="module")
def clean_parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "parts"
    assert main(["synth", str(folder), "--parts", "2", "--format", "AA99", "--seed", "3"]) == 0
    return folder


def test_stamped_parts_are_read(clean_parts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = ["--mode", "tactile", "--font", "gothic", "--format", "AA99", "--jobs", "1"]
    assert (
        main(
            [
                "read",
                str(clean_parts),
                *known,
                "--truth",
                str(clean_parts / "truth.csv"),
                "--out",
                "t.parquet",
            ]
        )
        == 0
    )
    shown = capsys.readouterr().out
    assert "characters 100.00% (0 edits in 8), serials 100.00% (2 of 2)" in shown
    table = pyarrow.parquet.read_table("t.parquet").to_pylist()
    assert [row["part"] for row in table] == ["part-000", "part-001"]
    assert all(row["error"] == "" and row["source"] == "tactile" for row in table)
    assert all(row["height_mm"] == pytest.approx(5.0, rel=0.1) for row in table)


def test_a_part_is_scanned_calibrated_read_and_drawn(
    clean_parts: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = truth_of(clean_parts)
    assert main(["scan", str(clean_parts / "part-000.npz"), "--out", "part-000.h5", "--height-mm", "5"]) == 0
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


def photograph(path: Path, text: str) -> None:
    Image.fromarray(stamp(text, fonts="gothic", height_mm=4.0, seed=3).photograph().pixels).save(path)


def stored(folder: Path) -> list[str]:
    with sqlite3.connect(folder / "parts.db") as connection:
        return [text for (text,) in connection.execute("select upper(text_folded) from parts order by id")]


def test_the_same_run_given_again_keeps_no_part_twice(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plates").mkdir()
    photograph(tmp_path / "plates" / "a.png", "K7")
    run = ("read", "plates", "--format", "A9", "--mode", "vision", "--jobs", "1")
    first = command(*run, "--out", "sqlite:///parts.db")
    assert (first.status, stored(tmp_path)) == (0, ["K7"])
    # its journal is gone: the store alone knows
    assert not list(tmp_path.glob("tactile-marks-*"))
    again = command(*run, "--out", "sqlite:///parts.db")
    assert (again.status, stored(tmp_path)) == (0, ["K7"])
    assert "1 parts were in the store already" in again.out
    # another plate under the name of the first is another part
    photograph(tmp_path / "plates" / "a.png", "M4")
    assert command(*run, "--out", "sqlite:///parts.db").status == 0
    assert stored(tmp_path) == ["K7", "M4"]
