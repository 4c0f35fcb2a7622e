"""Which trials a study makes of which files, and what people's answers add."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from glyphs.errors import FileError, MarksError
from pipeline.benchmark.study import repeats
from pipeline.benchmark.study.repeats import StudiedPart, StudyJournal, StudyPlan, studied_parts
from pipeline.benchmark.study.run import load_reviews
from pipeline.benchmark.study.study import Study
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob
from pipeline.reading.perturbation import Retake
from pipeline.workers.executors import Executor
from recognition.decide.reading import Reading
from tests.support.evidence import reading_of

MAP, RECORDED = PartFiles("m", height_map="m.npz"), PartFiles("r.1", scan="r.1.h5")
SECOND = PartFiles("r.2", scan="r.2.h5")


def measured(plan: StudyPlan, parts: Sequence[StudiedPart], folder: Path) -> list[Trial]:
    """All trials of a study in a folder, by this process."""
    with StudyJournal(folder, {"repeats": plan.repeats}) as journal:
        return repeats.measure(plan, parts, Executor(), journal)


@pytest.fixture
def requests(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Retake | None]]:
    """Every measurement that is requested, with its retake."""
    calls: list[tuple[str, Retake | None]] = []

    def read(job: PartJob) -> Reading:
        calls.append((job.files.name, job.retake))
        if job.files.name == "bad":
            raise MarksError("is broken")
        if job.files.name == "faulty":
            raise ZeroDivisionError("a fault")
        return reading_of("A 1")

    monkeypatch.setattr(repeats, "reading_of", read)
    return calls


def test_numbered_recordings_are_one_part_and_a_number_alone_is_none() -> None:
    parts = studied_parts([SECOND, MAP, RECORDED, PartFiles("v.1", scan="v.1.h5")])
    assert [(p.name, [r.name for r in p.recordings]) for p in parts] == [
        ("r", ["r.1", "r.2"]), ("m", ["m"]), ("v.1", ["v.1"]),
    ]  # fmt: skip
    assert [p.simulated for p in parts] == [False, True, False]


def test_recordings_come_as_they_are_and_what_lacks_is_perturbed(
    requests: list[tuple[str, Retake | None]], tmp_path: Path
) -> None:
    plan = StudyPlan(ReadSettings(), repeats=3, arrays=1)
    trials = measured(plan, studied_parts([RECORDED, SECOND, MAP]), tmp_path)
    assert [(m.part, m.number, m.levels["recorded"]) for m in trials] == [
        ("r", 1, True), ("r", 2, True), ("r", 3, False), ("m", 1, False), ("m", 2, False), ("m", 3, False),
    ]  # fmt: skip
    assert [name for name, _ in requests] == ["r.1", "r.2", "r.1", "m", "m", "m"]
    seeds = [again.seed for _, again in requests if again is not None]
    assert len(set(seeds)) == 4
    assert {m.text for m in trials} == {"A1"}
    assert {m.mode for m in trials} == {"the reader"}


def test_an_array_keeps_its_sensors_from_trial_to_trial(
    requests: list[tuple[str, Retake | None]], tmp_path: Path
) -> None:
    trials = measured(StudyPlan(ReadSettings(), 2, 2), studied_parts([MAP]), tmp_path)
    assert [(m.mode, m.number) for m in trials] == [
        ("array 1", 1), ("array 1", 2), ("array 2", 1), ("array 2", 2),
    ]  # fmt: skip
    assert [again.array for _, again in requests if again is not None] == [0, 0, 1, 1]
    assert len({again.seed for _, again in requests if again is not None}) == 4


def test_what_cannot_be_read_is_a_trial_with_its_error(
    requests: list[tuple[str, Retake | None]], tmp_path: Path
) -> None:
    parts = studied_parts([PartFiles("bad", scan="bad.h5"), PartFiles("faulty", scan="f.h5")])
    bad, faulty = measured(StudyPlan(ReadSettings(), 1, 1), parts, tmp_path)
    assert (bad.text, bad.error) == ("", "is broken")
    assert "please report it" in faulty.error


def test_a_study_goes_on_where_it_was_broken_off(
    requests: list[tuple[str, Retake | None]], tmp_path: Path
) -> None:
    plan = StudyPlan(ReadSettings(), repeats=2, arrays=1)
    first = measured(plan, studied_parts([MAP]), tmp_path)
    requests.clear()
    both = measured(plan, studied_parts([MAP, PartFiles("n", height_map="n.npz")]), tmp_path)
    assert both[:2] == first
    assert [name for name, _ in requests] == ["n", "n"]
    with pytest.raises(FileError, match=r"another study \(repeats was 2, now 3\)"):
        measured(StudyPlan(ReadSettings(), repeats=3, arrays=1), studied_parts([MAP]), tmp_path)


def test_answers_are_put_to_their_trials(tmp_path: Path) -> None:
    table = tmp_path / "reviews.csv"
    table.write_text("part,Reviewer,text\nm,Ada,A 1\nm.npz,Ada,A7\nm,Ben,\nother,Ben,X\n", encoding="utf-8")
    answers, unknown = load_reviews(table, {"m"})
    assert [(a.mode, a.part, a.number, a.text) for a in answers] == [
        ("Ada", "m", 1, "A1"), ("Ada", "m", 2, "A7"), ("Ben", "m", 1, ""),
    ]  # fmt: skip
    assert unknown == ("other",)


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ("part,text\nm,A1\n", "names no reviewer"),
        ("part,reviewer,text\nm,,A1\n", "line 2 names no reviewer"),
        ("part,reviewer,text\nx,Ada,A1\n", "answers no part"),
        ("part,reviewer,text\nm,Ada,A1\nm,Ada,A1\nn,Ada,A1\n", "2 times and others less often: n"),
    ],
)
def test_answers_that_cannot_be_used_are_refused(tmp_path: Path, lines: str, complaint: str) -> None:
    table = tmp_path / "reviews.csv"
    table.write_text(lines, encoding="utf-8")
    with pytest.raises(FileError, match=complaint):
        load_reviews(table, {"m", "n"})


def trials(part: str, depths: list[float | None]) -> list[Trial]:
    known = [{} if d is None else {"depth_mm": d} for d in depths]
    return [
        Trial(
            part,
            1 + k % 2,
            {"recorded": False},
            f"array {1 + k // 2}",
            "",
            "A1",
            "accept",
            0.9,
            measures=of_one,
        )
        for k, of_one in enumerate(known)
    ]


def test_a_part_whose_depth_is_not_known_each_time_is_left_out() -> None:
    measured = [
        *trials("a", [0.20, 0.21, 0.20, 0.21]), *trials("b", [0.30, 0.31, 0.30, 0.31]),
        *trials("c", [0.30, None, 0.30, 0.31]),
    ]  # fmt: skip
    ada = [Trial(part, 1, {"recorded": True}, "Ada", "", text) for part, text in (("a", "A1"), ("b", "B1"))]
    study = Study(tuple(measured), tuple(ada), {"a": "A1"})
    assert study.depthless == ("c",)
    assert study.depth is not None
    assert (study.depth.parts, study.depth.appraisers, study.depth.trials) == (2, 2, 2)
    assert study.appraisers == ("array 1", "array 2", "Ada")
    between = next(a for a in study.serials if a.kind == "between")
    assert between.disagreed == ("b",)
    assert all(not a.disagreed for a in study.serials if "truth" in a.kind)
    few = Study(tuple(measured[:4]))
    assert few.depth is None
    assert "fewer than two parts" in few.no_depth
    once = Study(tuple(m for m in measured if m.number == 1))
    assert "measured once" in once.no_depth
