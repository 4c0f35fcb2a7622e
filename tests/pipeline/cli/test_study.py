"""`study`: parts measured several times, from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.cli.main import main
from tests.pipeline.benchmark.report.test_report import Page
from tests.support.run_tables import csv_rows

pytestmark = pytest.mark.usefixtures("inline")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study") / "parts"
    assert (
        main(["synth", str(folder), "--parts", "2", "--format", "A9", "--font", "gothic", "--seed", "4"]) == 0
    )
    return folder


def test_two_parts_twice(parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, reviews = tmp_path / "out", tmp_path / "reviews.csv"
    truth = {row["part"]: row["text"] for row in csv_rows(parts / "truth.csv")}
    first, second = truth
    reviews.write_text(
        f"part,reviewer,text\n{first},Ada,{truth[first]}\n{second},Ada,??\nx,Ada,A1\n", encoding="utf-8"
    )
    arguments = [
        "study", str(parts), "--repeats", "2", "--font", "gothic", "--format", "A9",
        "--height-mm", "5", "--truth", str(parts / "truth.csv"), "--reviewers", str(reviews), "--out", str(out),
    ]  # fmt: skip
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    read = csv_rows(out / "readings.csv")
    assert [(r["appraiser"], r["trial"]) for r in read if r["part"] == first] == [
        *((f"array {a}", str(k)) for a in (1, 2) for k in (1, 2)), ("Ada", "1"),
    ]  # fmt: skip
    by_program = [r for r in read if r["appraiser"] != "Ada"]
    assert all(r["text"] == truth[r["part"]] and r["right"] == "1" for r in by_program)
    depths = [float(r["depth_mean_mm"]) for r in by_program]
    assert len(set(depths)) == len(depths)  # no two trials are the same
    # as it is stamped unless --depth-mm is given, less what practice, ball and place take
    assert all(0.1 < d < 0.3 for d in depths)
    figures = json.loads((out / "study.json").read_text(encoding="utf-8"))
    agreement = {(a["kind"], a["who"]): a for a in figures["serials"]}
    assert agreement["within", "array 1"]["parts"]["count"] == 2
    assert agreement["between", "array 1, array 2, Ada"]["disagreed"] == [second]
    assert agreement["against truth", "Ada"]["parts"]["count"] == 1
    assert ("between", "array 1, array 2") in {(a["kind"], a["who"]) for a in figures["decisions"]}
    assert figures["depth"]["repeatability_mm"] > 0.0
    assert "| serials | against truth | Ada | 1 | 2 | 50.0 |" in (out / "study.md").read_text(
        encoding="utf-8"
    )
    page = Page((out / "study.html").read_text(encoding="utf-8"))
    assert {"serials", "decisions", "depth", "parts", "settings"} <= set(page.ids)
    assert "Reviewers read 1 parts that are not in this study: x." in page.text
    assert "??" in page.text
    assert f"wrote {out / 'study.html'}" in printed
    assert "Depth, " in printed


def test_a_photograph_has_one_array_and_no_depth(
    parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [
        "study", str(parts), "--repeats", "2", "--mode", "vision", "--format", "A9", "--out", str(tmp_path),
    ]  # fmt: skip
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "have one array" in printed
    assert "no gauge study" in printed
    assert {r["appraiser"] for r in csv_rows(tmp_path / "readings.csv")} == {"the reader"}
    assert json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))["depth"] is None
    assert not (tmp_path / "study.unfinished").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [
        ([], 2, "name parts"),
        (["PARTS", "--repeats", "0"], 2, "Must be >= 1"),
        (["PARTS", "--format", "A(", "--font", "nowhere"], 2, "nowhere"),
        (["missing/"], 1, "missing"),
    ],
)
def test_what_cannot_be_studied_is_refused(
    parts: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    complaint: str,
) -> None:
    words = [str(parts) if a == "PARTS" else a for a in arguments]
    assert main(["study", *words, "--out", str(tmp_path / "out")]) == status
    assert complaint in capsys.readouterr().err


def test_a_part_that_cannot_be_read_is_named_and_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.npz").write_bytes(b"no archive")
    assert main(["study", str(tmp_path / "bad.npz"), "--repeats", "2", "--out", str(tmp_path / "out")]) == 1
    read = csv_rows(tmp_path / "out" / "readings.csv")
    assert len(read) == 4
    assert all(r["error"] for r in read)
    assert "1 parts could not be read in every trial" in capsys.readouterr().err
