"""The report: whole, self-contained, and true to the trials."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.report import writing as report
from pipeline.benchmark.report.page import mark_characters
from pipeline.benchmark.report.worst_parts import WorstPart, draw_worst, rank_worst
from pipeline.benchmark.trials.journal import ReadCharacter, Trial, TrialJournal
from pipeline.benchmark.trials.run import Benchmark
from pipeline.cli.main import main
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from tests.support.run_tables import csv_rows

SECTIONS = (
    "wrong", "summary", "accuracy", "decisions",
    "risk", "confidence", "confusion", "worst", "time", "settings",
)  # fmt: skip


class Page(HTMLParser):
    """What a page refers to; its tags close, its references are found, and it needs nothing beside it."""

    VOID = frozenset({"meta", "img", "br", "link"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.refers: list[str] = []
        self.ids: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)
        assert self.open == []
        assert all(r.startswith(("data:image/", "#")) for r in self.refers)
        assert {r[1:] for r in self.refers if r.startswith("#")} <= set(self.ids)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                self.refers.append(value or "")
            if name == "id":
                self.ids.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def trial(part: int, text: str, **more: object) -> Trial:
    fields: dict[str, object] = {
        "part": f"gothic-A9-0.3-{part:04d}", "number": part,
        "levels": {"severity": 0.3, "font": "gothic", "format": "A9"},
        "mode": "tactile", "truth": "A1", "decision": "accept", "confidence": 0.9,
        "characters": tuple(ReadCharacter(c, 0.95, 0.9) for c in text), "compute_s": 1.0, "scan_s": 60.0,
        "simulated_s": 0.75 if more.get("mode", "tactile") == "tactile" else 0.0,
    }  # fmt: skip
    return Trial(text=text, **{**fields, **more})  # type: ignore[arg-type]


TRIALS = [
    trial(0, "A1"), trial(1, "A7"), trial(2, "A7", decision="review"), trial(3, "A", decision="reject"),
    trial(4, "", decision="", characters=(), error="<b>it & broke</b>"),
    *(trial(k, "A1", mode="vision") for k in range(5)),
    *(trial(k, "A1", mode="fused") for k in range(5)),
]  # fmt: skip


def not_drawn(_: Benchmark, ranked: tuple[WorstPart, Item]) -> WorstPart:
    return replace(ranked[0], picture="data:image/jpeg;base64,AAAA")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    parts = designed_parts(parts=5)
    benchmark = Benchmark(parts, ("tactile", "vision", "fused"), ReaderSettings())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "draw_worst", not_drawn)
        patch.setattr("sys.argv", ["/bin/tactile-marks", "benchmark", "run", "--seed", "1"])
        folder = tmp_path_factory.mktemp("report")
        report.write_report(benchmark, TRIALS, folder)
    return folder


def test_the_page_is_whole_and_needs_nothing_beside_it(written: Path) -> None:
    text = (written / report.PAGE).read_text(encoding="utf-8")
    page = Page(text)
    assert set(SECTIONS) <= set(page.ids)
    assert not re.search(r"https?://|@import|<script|url\(", text)
    assert "tactile-marks benchmark run --seed 1" in page.text
    assert "<b>it & broke</b>" in page.text  # shown, not obeyed
    assert "tactile: 5 mistakes" in page.text
    assert "1 read 7" in page.text


def test_the_table_has_a_line_a_trial(written: Path) -> None:
    rows = csv_rows(written / report.TABLE)
    assert len(rows) == len(TRIALS)
    assert [r["characters_right"] for r in rows[:5]] == ["2", "1", "1", "1", "0"]
    assert [r["right"] for r in rows[:5]] == ["1", "0", "0", "0", "0"]
    assert rows[4]["error"] == "<b>it & broke</b>"


def test_the_figures_are_those_of_the_trials(written: Path) -> None:
    told = json.loads((written / report.FIGURES).read_text(encoding="utf-8"))
    tactile = next(g for g in told["by_severity"] if g["mode"] == "tactile")
    assert (tactile["serials"]["count"], tactile["characters"]["count"]) == (1, 5)
    assert tactile["split"] == {
        "accepted_right": 1, "accepted_wrong": 1, "review": 1, "rejected": 1, "failed": 1,
    }  # fmt: skip
    assert told["parts"] == 5
    times = told["times"][0]
    assert times["scan_s_median_p95"] == [60.0, 60.0]
    assert (times["compute_s_median_p95"], times["simulated_s_median_p95"]) == ([1.0, 1.0], [0.75, 0.75])
    assert times["reading_s_median_p95"] == [0.25, 0.25]


def test_the_worst_parts_begin_with_the_lie(written: Path) -> None:
    worst = rank_worst(TRIALS)
    assert worst[0].part.endswith("0001")
    assert worst[0].why == "tactile: accepted but wrong"
    assert [w.part[-1] for w in worst] == ["1", "4", "2", "3", "0"]
    assert worst[1].why == "tactile: an error"
    assert worst[-1].why.startswith("tactile: right (")  # accepted, so not called uncertain
    assert [t.mode for t in worst[0].trials] == ["tactile", "vision", "fused"]
    assert mark_characters(TRIALS[3]) == [("A", True), ("·", False)]


def test_a_part_that_is_made_otherwise_today_is_not_shown_for_the_one_that_was_read() -> None:
    parts = designed_parts()
    benchmark = Benchmark(parts, ("tactile",), ReaderSettings())
    item = parts.items()[0]
    truth = parts.make(item).truth
    read = WorstPart((trial(0, "A1", truth="?" + truth),), "", "font,height,format")
    shown = draw_worst(benchmark, (read, item))
    assert (shown.picture, shown.problem) == ("", f"made again, it is another part, with {truth} stamped")


def test_two_parts_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = [
        "benchmark", "run", "--out", str(out), "--dirt", "0", "--parts", "2", "--mode", "tactile",
        "--format", "99", "--give", "font,height,format",
    ]  # fmt: skip
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert max(len(line) for line in printed.splitlines() if not line.startswith("wrote")) <= 80
    assert f"wrote {out / 'report.html'}" in printed
    row, *_ = (line.split() for line in printed.splitlines() if line.startswith(" tactile"))
    assert row[:3] == ["tactile", "2", "0.0"]
    times = [(float(r["reading_s"]), float(r["compute_s"])) for r in csv_rows(out / "benchmark.csv")]
    assert all(0.0 < reading < compute for reading, compute in times)  # the scan is simulated
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    assert sum(r.startswith("data:image/jpeg") for r in page.refers) == 2
    assert TrialJournal.read(out).description["parts"]["seed"] == 1
    assert main([*arguments, "--seed", "2"]) == 1
    assert "holds another benchmark" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--inputs", "x"], "go together"),
        (["--jobs", "0"], "Must be >= 1"),
        (["--dirt", "a"], "numbers separated by commas"),
        (["--dirt", "2"], "between 0 and 1"),
        (["--mode", "smell"], "no mode 'smell'"),
        (["--parts", "0"], '"0" for --parts'),
        (["--design", "marks-exam-1-40", "--height-mm", "4"], "and --height-mm both describe the parts"),
        (["--design", "marks-exam-1-40", "--parts", "41"], "the design has 40"),
        (["--inputs", "x", "--truth", "y"], "--parts is for parts that are made"),
    ],
)
def test_bad_usage_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], complaint: str
) -> None:
    parts = [] if "--parts" in more else ["--parts", "1"]
    assert main(["benchmark", "run", "--out", str(tmp_path / "o"), *parts, *more]) == 2
    assert complaint in capsys.readouterr().err


def test_a_page_is_written_of_parts_that_all_failed(tmp_path: Path) -> None:
    failed = Trial(
        designed_parts().items()[0].part, 0, {"severity": 0.3}, "tactile", "", error="MarksError: no land"
    )
    benchmark = Benchmark(designed_parts(), ("tactile",), ReaderSettings())
    report.write_report(benchmark, [failed], tmp_path)
    assert "no land" in (tmp_path / report.PAGE).read_text(encoding="utf-8")
