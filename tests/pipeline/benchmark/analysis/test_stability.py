"""What flips under perturbations: counted by hand, shown, and a fault that fails the run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.benchmark.analysis.changes import changes
from pipeline.benchmark.analysis.comparisons import Fault, stability_of
from pipeline.benchmark.analysis.statistics import statistics_of
from pipeline.benchmark.exam.condition import PERTURBED
from pipeline.benchmark.readers.own_reader import Answer, ExamPart
from pipeline.benchmark.report import writing
from pipeline.benchmark.report.worst_parts import WorstPart
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.cli.main import main
from pipeline.reading.perturbation import PERTURBATIONS
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from tests.support.run_tables import csv_rows
from whisker_array.simulation.traces import Fidelity

pytestmark = pytest.mark.usefixtures("inline")


def trial(part: int, read: str, perturbed: str = "") -> Trial:
    """`read` is a text and the first letter of a decision."""
    text, letter = read.split()
    levels = {"severity": 0.3, **({PERTURBED: perturbed} if perturbed else {})}
    decision = {"a": "accept", "r": "review"}[letter]
    return Trial(f"p{part}", part, levels, "tactile", "A1", text, decision, 0.9)


TRIALS = [
    *(trial(k, read) for k, read in enumerate(["A1 a", "A1 a", "A7 a", "A1 r"])),
    *(trial(k, read, "shift") for k, read in enumerate(["A1 a", "A1 r", "A1 a", "A7 r"])),
    *(trial(k, read, "noise") for k, read in enumerate(["A1 a", "A1 r", "A7 a", "A1 a"])),
]


def test_flips_are_counted_part_by_part() -> None:
    whole, shift, noise = stability_of(TRIALS)
    assert (whole.perturbation, shift.perturbation, noise.perturbation) == ("", "shift", "noise")
    counted = [
        (s.verdicts.count, s.verdicts.total, s.texts.count, s.accepted_texts.count, s.accepted_texts.total)
        for s in (whole, shift, noise)
    ]
    # of any: p1 and p3 change their decision (p1 twice, counted once), p2 and p3 their text
    assert counted == [(2, 4, 2, 1, 3), (1, 4, 2, 1, 3), (2, 4, 0, 0, 3)]
    assert shift.faults == whole.faults == (Fault("p2", "shift", "A1", "A7", "A1"),)
    assert noise.faults == ()
    # Clopper and Pearson: none of 3, 1 - 0.05^(1/3)
    assert noise.accepted_texts.high == pytest.approx(1.0 - 0.05 ** (1 / 3))


def test_all_other_findings_are_of_parts_as_they_are() -> None:
    statistics = statistics_of(TRIALS)
    assert [g.serials.total for g in statistics.by_mode] == [4]
    assert PERTURBED not in statistics.levels
    assert statistics_of(TRIALS[:4]).stability == ()
    assert changes(TRIALS, TRIALS[:4]).flips == ()


SIZES: dict[str, float] = {}


def misled(part: ExamPart) -> Answer:
    """Accepts another serial once the part is of another size."""
    width = part.surface[0].shape[1] * part.surface[1]
    same = SIZES.setdefault(part.name, width) == width
    return Answer("A1" if same else "B2", 0.95)


def steadfast(part: ExamPart) -> str:
    return "A1"


def test_every_part_is_read_again_by_those_whom_the_perturbation_reaches(tmp_path: Path) -> None:
    SIZES.clear()
    reading = ReaderSettings(array=VirtualArray(fidelity=Fidelity.POINTWISE))
    names = tuple(f"{__name__}:{reader.__name__}" for reader in (misled, steadfast))
    benchmark = Benchmark(designed_parts(), names, reading, PERTURBATIONS)
    trials = run_benchmark(benchmark, tmp_path)
    assert [t.perturbed for t in trials if t.mode == names[0]] == ["", *(p.name for p in PERTURBATIONS)]
    assert [t.text for t in trials if t.mode == names[0]] == ["A1", "A1", "A1", "A1", "B2", "A1"]
    assert run_benchmark(benchmark, tmp_path) == trials  # from the journal


def undrawn(_: Benchmark, ranked: tuple[WorstPart, object]) -> WorstPart:
    """A part's pictures, not drawn: what they cost is not what is asked here."""
    return ranked[0]


def test_an_accepted_serial_that_becomes_another_fails_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "draw_worst", undrawn)
    SIZES.clear()
    arguments = [
        "benchmark", "run", "--perturb", "--dirt", "0", "--parts", "1", "--format", "A9",
    ]  # fmt: skip
    bad, good = (f"{__name__}:{reader.__name__}" for reader in (misled, steadfast))
    assert main([*arguments, "--mode", bad, "--out", str(tmp_path / "bad")]) == 1
    printed = capsys.readouterr()
    assert "accepted as A1, and under scale as B2" in printed.out
    assert "became other accepted serials" in printed.err
    page = (tmp_path / "bad" / "report.html").read_text(encoding="utf-8")
    assert 'id="stability"' in page
    assert "Accepted as one serial, and perturbed as another" in page
    stability = json.loads((tmp_path / "bad" / "benchmark.json").read_text())["stability"]
    assert [s["perturbation"] for s in stability] == ["", *(p.name for p in PERTURBATIONS)]
    rows = csv_rows(tmp_path / "bad" / "benchmark.csv")
    assert [row["perturbed"] for row in rows] == ["", *(p.name for p in PERTURBATIONS)]
    assert main([*arguments, "--mode", good, "--out", str(tmp_path / "good")]) == 0
    assert "FAULT" not in capsys.readouterr().out
