"""A lot teaches itself: what the second pass reads, what it changes, and how a run goes on that broke off in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.part_files import PartFiles
from pipeline.reading.enrolment import EnrolReport
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.runs.options import RunOptions
from pipeline.runs.outputs import RunJournal
from pipeline.runs.run import Run, open_run
from pipeline.runs.second_pass import SecondPass, runs_second_pass
from recognition.enrol.exemplars import ExemplarError
from tests.support.run_tables import FakeExecutor, read_rows

JOB = PartJob(settings=ReadSettings(format=("A9",)))
PARTS = [PartFiles(f"p{k:02d}", height_map=f"/lot/p{k:02d}.npz") for k in range(14)]
TEXTS = {part.name: f"{'ABC'[k % 3]}{k % 2}" for k, part in enumerate(PARTS)}
UNSURE = {"p03", "p05", "p08", "p11"}


def record(
    name: str, text: str, decision: str = "accept", confidence: float = 0.95, **more: Any
) -> ReadingRecord:
    return ReadingRecord("tactile", text, decision, confidence, part=name, **more)


def first_reading(name: str) -> ReadingRecord:
    return record(name, TEXTS[name], "review", 0.5) if name in UNSURE else record(name, TEXTS[name])


SECOND = {
    "p03": record("p03", "C9", font="lot-die"),  # accepted: taken, whatever it says
    "p05": record("p05", TEXTS["p05"], "review", 0.8, font="lot-die"),  # surer of the same
    "p08": record("p08", "C9", "review", 0.85, font="lot-die"),  # another text, not accepted
    "p11": ReadingRecord.failed("p11", "p11.npz: its worker is lost"),
}
CHANGED = {"p03": ("C9", "accept"), "p05": (TEXTS["p05"], "review")}


class Reads(FakeExecutor):
    """Answers by the fonts of the order.

    Attributes:
        fonts: of the order, for every part that was asked for.
    """

    def __init__(self, **how: Any) -> None:
        super().__init__(self.reading, **how)
        self.fonts = list[tuple[str, ...]]()

    def reading(self, part: PartFiles, job: PartJob) -> ReadPart:
        self.fonts.append(job.settings.font)
        return ReadPart((SECOND[part.name] if job.settings.font else first_reading(part.name),))

    @property
    def again(self) -> list[str]:
        return [name for name, font in zip(self.read, self.fonts, strict=True) if font]


REPORT = EnrolReport("lot-die", (("p00", "A0"),), (), (), (), 20, "AB", "Z", False, "gothic", 0.8)


@pytest.fixture
def enrolled(monkeypatch: pytest.MonkeyPatch) -> list[list[PartFiles]]:
    """The parts of each enrolment."""
    calls: list[list[PartFiles]] = []

    def enrol(parts: Sequence[PartFiles], database: Path, *, vouching: bool, **_: Any) -> EnrolReport:
        assert not vouching
        calls.append(list(parts))
        database.write_bytes(b"shapes")
        return REPORT

    monkeypatch.setattr("pipeline.reading.enrolment.enrol", enrol)
    return calls


def run_of(book: RunJournal, **more: Any) -> Run:
    return Run(book, second=SecondPass(book.table.with_suffix(".die.glyphs"), **more))


def rows_of(path: Path) -> dict[str, tuple[str, str]]:
    return {row.part: (row.text, row.decision) for row in read_rows(path)}


EXPECTED = {
    part.name: CHANGED.get(part.name, (TEXTS[part.name], first_reading(part.name).decision)) for part in PARTS
}


@pytest.mark.parametrize("suffix", [".csv", ".jsonl", ".parquet"])
def test_what_was_not_accepted_is_read_again_and_the_better_counts(
    suffix: str, tmp_path: Path, enrolled: list[list[PartFiles]]
) -> None:
    path, executor = tmp_path / f"rows{suffix}", Reads()
    with RunJournal(path, {}) as book:
        run = run_of(book)
        run.work(PARTS, JOB, executor)
    assert executor.again == sorted(UNSURE)
    assert executor.fonts[-1] == ("lot-die",)
    assert rows_of(path) == EXPECTED
    assert [*rows_of(path)] == [part.name for part in PARTS]
    assert {p.name for p in enrolled[0]} == {p.name for p in PARTS} - UNSURE
    # the counts are of the rows in the table
    assert (run.summary.decisions["accept"], run.summary.decisions["review"]) == (11, 3)
    assert (run.read_now, run.second.again if run.second else 0) == (14, 4)
    # and nothing stays beside the table but what was learned
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([path.name, "rows.die.glyphs"])


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_run_broken_off_in_the_second_pass_goes_on_there(
    suffix: str, tmp_path: Path, enrolled: list[list[PartFiles]]
) -> None:
    path = tmp_path / f"rows{suffix}"
    executors = [Reads(breaks_after=9), Reads(breaks_after=7), Reads(breaks_after=1)]
    for executor in executors:
        with RunJournal(path, {}) as book, pytest.raises(KeyboardInterrupt):
            run_of(book).work(PARTS, JOB, executor)
        # the table that grows has each part once, in the second pass too
        assert suffix != ".csv" or len(rows_of(path)) == len(read_rows(path))
    with RunJournal(path, {}) as book:
        last = Reads()
        run = run_of(book)
        run.work(PARTS, JOB, last)
    # each part once in either pass
    assert [len(e.read) for e in executors] == [9, 7, 1]
    assert [e.again for e in (*executors, last)] == [[], ["p03", "p05"], ["p08"], ["p11"]]
    assert len(last.read) == 1
    assert rows_of(path) == EXPECTED
    assert run.summary.parts == 14
    # taught by the same parts each time, not by what the second pass accepted
    assert enrolled[0] == enrolled[1] == enrolled[2]


@pytest.mark.parametrize(
    ("report", "words"),
    [
        (replace(REPORT, agreement=0.5), "do not look like one die's (only 50% of their characters agree)"),
        (replace(REPORT, exemplars=0), "too few of its parts were read with certainty"),
        (ExemplarError("no character has 3 exemplars that agree"), "no character has 3 exemplars"),
    ],
)
def test_a_lot_that_teaches_nothing_keeps_its_first_readings(
    report: EnrolReport | Exception,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def enrol(parts: Sequence[PartFiles], database: Path, **_: Any) -> EnrolReport:
        database.write_bytes(b"shapes")
        if isinstance(report, Exception):
            database.unlink()
            raise report
        return report

    monkeypatch.setattr("pipeline.reading.enrolment.enrol", enrol)
    executor = Reads()
    with RunJournal(tmp_path / "rows.csv", {}) as book:
        run_of(book).work(PARTS, JOB, executor)
    assert executor.again == []
    assert rows_of(tmp_path / "rows.csv") == {
        name: (TEXTS[name], first_reading(name).decision) for name in TEXTS
    }
    assert words in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["rows.csv"]


def test_parts_with_a_font_of_their_own_or_without_touch_neither_teach_nor_learn(
    tmp_path: Path, enrolled: list[list[PartFiles]]
) -> None:
    parts = [*PARTS]
    parts[0] = replace(parts[0], font="gothic")
    parts[1] = replace(parts[1], height_map="", photos=("/lot/p01.png",))
    parts[2] = replace(parts[2], height_map="", scan="s3://lot/p02.h5")  # far away: may learn, cannot teach
    parts[3] = replace(parts[3], font="gothic")  # unsure
    executor = Reads()
    with RunJournal(tmp_path / "rows.csv", {}) as book:
        run_of(book).work(parts, JOB, executor)
    assert executor.again == sorted(UNSURE - {"p03"})
    assert {p.name for p in enrolled[0]}.isdisjoint({"p00", "p01", "p02", "p03"})


# ---------------------------------------------------------------------------------------------------- when it happens


@pytest.mark.parametrize(
    ("options", "settings", "parts", "answer"),
    [
        ({}, {}, PARTS, True),
        ({}, {}, PARTS[:11], False),
        ({"learn_die": True}, {}, PARTS[:3], True),
        ({"learn_die": False}, {}, PARTS, False),
        ({}, {"font": ("gothic",)}, PARTS, "whose font is unknown"),
        ({}, {"database": Path("press.glyphs")}, PARTS, "whose font is unknown"),
        ({}, {"mode": "vision"}, PARTS, "learns by touch"),
        ({}, {"experts": ("network",)}, PARTS, "needs the expert `templates`"),
        ({}, {"experts": ("network", "templates")}, PARTS, True),
        ({"out": "sqlite:///parts.db"}, {}, PARTS, "works only when a table is written"),
        ({}, {}, [replace(part, height_map="", photos=("a.png",)) for part in PARTS], False),
        ({}, {}, [replace(part, font="gothic") for part in PARTS], False),
    ],
)
def test_a_felt_lot_of_an_unknown_die_teaches_itself_unless_it_is_small(
    options: dict[str, Any], settings: dict[str, Any], parts: Sequence[PartFiles], answer: bool | str
) -> None:
    """A text as answer says why it cannot, where it is asked for."""
    assert runs_second_pass(RunOptions(**options), ReadSettings(**settings), parts) is (answer is True)
    if isinstance(answer, str):
        with pytest.raises(SettingsError, match=answer):
            runs_second_pass(RunOptions(**options, learn_die=True), ReadSettings(**settings), parts)


def test_what_an_earlier_run_learned_is_moved_as_its_table_is(tmp_path: Path) -> None:
    database = tmp_path / "rows.die.glyphs"
    database.write_bytes(b"of the lot before")
    options = RunOptions(out=str(tmp_path / "rows.csv"))
    with open_run(options, {}, second_pass=True) as run:
        assert run.second is not None
        assert run.second.database == database
        assert not database.exists()
        assert (tmp_path / "rows.die.glyphs~").read_bytes() == b"of the lot before"
        run.journal.keep("p00", ReadPart((first_reading("p00"),)))
        database.write_bytes(b"of this lot")
    with open_run(options, {}, second_pass=True):
        assert database.read_bytes() == b"of this lot"


def test_without_a_table_a_lot_teaches_itself_all_the_same(enrolled: list[list[PartFiles]]) -> None:
    told: dict[str, str] = {}
    with open_run(RunOptions(), {}, second_pass=True) as run:
        run.on_row = lambda row: told.update({row.part: row.text})
        assert run.second is not None
        run.work(PARTS, JOB, Reads())
        assert run.second.database.exists()
    assert told == {name: text for name, (text, _) in EXPECTED.items()}
    assert not run.second.database.exists()
