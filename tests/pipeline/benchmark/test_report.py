"""The report: whole, self-contained, and true to the trials."""

import csv
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pipeline.benchmark import report
from pipeline.benchmark.run import Benchmark
from pipeline.benchmark.specimens import Item
from pipeline.benchmark.statistics import statistics_of
from pipeline.benchmark.targets import TARGETS, verdicts
from pipeline.benchmark.trials import ReadCharacter, Trial
from pipeline.benchmark.worst_parts import WorstPart, marked, rank_worst
from pipeline.cli.main import main
from recognition.reader_settings import ReaderSettings
from tests.factories import designed_parts

SECTIONS = (
    "targets", "summary", "accuracy", "decisions", "risk", "confidence", "confusion", "worst", "time", "settings",
)  # fmt: skip


class Page(HTMLParser):
    """What a page refers to, and whether its tags close."""

    VOID = frozenset({"meta", "img", "br", "link"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.refers: list[str] = []
        self.ids: list[str] = []
        self.headings = 0
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

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
    given: dict[str, object] = {
        "part": f"gothic-A9-0.3-{part:04d}", "number": part,
        "levels": {"severity": 0.3, "font": "gothic", "format": "A9"},
        "mode": "tactile", "truth": "A1", "decision": "accept", "confidence": 0.9,
        "characters": tuple(ReadCharacter(c, 0.95, 0.9) for c in text), "compute_s": 1.0, "scan_s": 60.0,
        "simulated_s": 0.75 if more.get("mode", "tactile") == "tactile" else 0.0,
    }  # fmt: skip
    return Trial(text=text, **{**given, **more})  # type: ignore[arg-type]


TRIALS = [
    trial(0, "A1"), trial(1, "A7"), trial(2, "A7", decision="review"), trial(3, "A", decision="reject"),
    trial(4, "", decision="", characters=(), error="<b>it & broke</b>"),
    *(trial(k, "A1", mode="vision") for k in range(5)),
    *(trial(k, "A1", mode="fused") for k in range(5)),
]  # fmt: skip


def not_drawn(_: Benchmark, ranked: tuple[WorstPart, Item]) -> WorstPart:
    return replace(ranked[0], picture="data:image/jpeg;base64,AAAA")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> report.Written:
    parts = designed_parts(parts=5)
    benchmark = Benchmark(parts, ("tactile", "vision", "fused"), ReaderSettings())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "draw_worst", not_drawn)
        folder = tmp_path_factory.mktemp("report")
        return report.write_report(benchmark, TRIALS, folder, command="tactile-marks benchmark --seed 1")


def test_the_page_is_whole_and_needs_nothing_beside_it(written: report.Written) -> None:
    text = written.page.read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert set(SECTIONS) <= set(page.ids)
    assert all(r.startswith(("data:image/", "#")) for r in page.refers)
    assert {r[1:] for r in page.refers if r.startswith("#")} <= set(page.ids)
    assert not re.search(r"https?://|@import|<script|url\(", text)
    assert "tactile-marks benchmark --seed 1" in page.text
    assert "<b>it & broke</b>" in page.text  # shown, not obeyed


def test_the_table_has_a_line_a_trial(written: report.Written) -> None:
    with written.table.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(TRIALS)
    assert [r["characters_right"] for r in rows[:5]] == ["2", "1", "1", "1", "0"]
    assert [r["right"] for r in rows[:5]] == ["1", "0", "0", "0", "0"]
    assert rows[4]["error"] == "<b>it & broke</b>"


def test_the_figures_are_those_of_the_trials(written: report.Written) -> None:
    told = json.loads(written.figures.read_text(encoding="utf-8"))
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


def test_the_time_of_reading_stands_beside_the_accuracy(written: report.Written) -> None:
    text = written.page.read_text(encoding="utf-8")
    summary = text[text.index('id="summary"') : text.index('id="accuracy"')]
    assert "<th>reading, ms</th>" in summary
    assert "<td>250</td><td>250</td></tr>" in summary  # tactile, less the simulated scan
    assert "<td>1000</td><td>1000</td></tr>" in summary  # vision
    with written.table.open(encoding="utf-8", newline="") as stream:
        first = next(csv.DictReader(stream))
    assert [float(first[k]) for k in ("compute_s", "reading_s", "simulated_s")] == [1.0, 0.25, 0.75]


def test_the_worst_parts_begin_with_the_lie(written: report.Written) -> None:
    worst = rank_worst(TRIALS)
    assert worst[0].part.endswith("0001")
    assert worst[0].why == "tactile: accepted but wrong"
    assert [w.part[-1] for w in worst] == ["1", "4", "2", "3", "0"]
    assert worst[1].why == "tactile: an error"
    assert [t.mode for t in worst[0].trials] == ["tactile", "vision", "fused"]
    assert marked(TRIALS[3]).letters == (("A", True), ("·", False))


def test_targets_are_met_missed_or_not_measured() -> None:
    judged = verdicts(statistics_of(TRIALS))
    by_target = {(v.mode, v.severity, v.target): v for v in judged}
    characters = by_target[("tactile", 0.3, "characters right at least 99.9%")]
    assert (characters.met, characters.sure) == (False, True)  # 5 of 10: at most 76 %
    assert by_target[("tactile", 0.9, "characters right at least 95.0%")].met is None
    wrong = by_target[("tactile", 0.3, "serials accepted but wrong at most 0.1%")]
    assert (wrong.met, wrong.sure) == (False, True)  # 1 of 5: at least 3.6 %
    fused = judged[len(TARGETS)]
    assert (fused.mode, fused.met) == ("fused", True)
    assert "vision" in fused.target


def test_a_fused_mode_that_loses_is_not_met_and_chance_is_told() -> None:
    trials = [t for t in TRIALS if t.mode != "fused"]
    lost = [trial(k, "A1" if k else "A7", mode="fused") for k in range(5)]
    verdict = verdicts(statistics_of([*trials, *lost]))[len(TARGETS)]
    assert (verdict.met, verdict.sure) == (False, False)
    assert "no more than chance" in verdict.found


def test_two_parts_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    arguments = [
        "benchmark", "--out", str(out), "--dirt", "0", "--parts", "2", "--mode", "tactile",
        "--format", "99", "--fidelity", "pointwise",
    ]  # fmt: skip
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert f"wrote {out / 'report.html'}" in said
    assert said.splitlines()[0].endswith(" ms read ms")
    row = said.splitlines()[1].split()
    assert row[1] == "tactile"
    assert 0 < int(row[-1]) < int(row[-2])  # the scan is simulated
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    assert sum(r.startswith("data:image/jpeg") for r in page.refers) == 2
    first = json.loads((out / "benchmark.json").read_text())
    monkeypatch.setattr(report, "draw_worst", not_drawn)
    assert main(arguments) == 0  # nothing is missing; only the report is written again
    again = json.loads((out / "benchmark.json").read_text())
    assert first == again
    assert main([*arguments, "--seed", "2"]) == 1
    assert "holds another benchmark" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--inputs", "x"], "go together"),
        (["--jobs", "0"], "at least 1"),
        (["--dirt", "a"], "numbers separated by commas"),
        (["--dirt", "2"], "between 0 and 1"),
        (["--mode", "smell"], "no mode 'smell'"),
    ],
)
def test_bad_usage_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], complaint: str
) -> None:
    assert main(["benchmark", "--out", str(tmp_path / "o"), "--parts", "1", *more]) == 2
    assert complaint in capsys.readouterr().err
