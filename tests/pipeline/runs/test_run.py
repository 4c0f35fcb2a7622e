"""A run's bookkeeping: what is kept of every part, what its settings change, and what a lot teaches itself."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import sqlalchemy as sa

from glyphs.errors import FileError
from glyphs.fonts.outlines import load_font
from glyphs.surface.maps import HeightMap
from pipeline.common.people_records import Person
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind, ReviewAction
from pipeline.common.serial_rules import ProductionOrder, SerialRules
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.manifest import read_manifest
from pipeline.formats.npz import write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.drift import EVERY, DriftWatch
from pipeline.reading.part_job import PartJob, Wants, files_to_send, read_listed, with_local_files
from pipeline.reading.triage import ReadPart
from pipeline.runs.lot import (
    EXEMPLARS_EACH,
    LEAST_AGREEMENT,
    MOST_TEACHERS,
    is_better,
    needs_another,
    teachers,
)
from pipeline.runs.options import RunOptions
from pipeline.runs.outputs import RunJournal
from pipeline.runs.production import run_batch
from pipeline.runs.run import Run, open_run
from pipeline.store.store import Store
from pipeline.workers.executors import Executor
from recognition.enrol.exemplars import ExemplarError
from recognition.enrol.learned_font import Learned, agreement, learn_font
from tests.support.certificates import a_certificate, measured
from tests.support.felt import blow
from tests.support.run_tables import FakeExecutor, csv_rows, read_rows

JOB = PartJob(settings=ReadSettings(font=("gothic",), height_mm=3.0, experts=("network",)))
PARTS = [PartFiles(f"p{k}", height_map=f"p{k}.npz") for k in range(6)]


def record(part: PartFiles, text: str, confidence: float = 0.9) -> ReadingRecord:
    return ReadingRecord("tactile", text, "accept", confidence, part=part.name)


@pytest.fixture
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sqlalchemy")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    write_npz(tmp_path / "a.npz", HeightMap(np.zeros((40, 60), np.float32), 0.1))
    return tmp_path / "a.npz"


def reading(
    *bad: str, text: Callable[[PartFiles], str] = lambda part: f"T{part.name[1:]}", **how: Any
) -> FakeExecutor:
    """Reads a text of every part but the bad ones, from the last to the first."""

    def answer(part: PartFiles, _: PartJob) -> ReadPart | Exception:
        lost = RuntimeError("its worker\nis lost")
        return lost if part.name in bad else ReadPart((record(part, text(part)),))

    return FakeExecutor(answer, backwards=True, **how)


def test_a_run_broken_off_goes_on_and_ends_in_order(tmp_path: Path) -> None:
    path, marker = tmp_path / "rows.csv", tmp_path / "rows.csv.unfinished"
    for breaks_after, bad in ((2, ["p5"]), (3, ["p1"])):
        with RunJournal(path, {"a": 1}) as book:
            run = Run(book, tmp_path / "bad.csv")
            with pytest.raises(KeyboardInterrupt):
                run.work(PARTS, JOB, reading(*bad, breaks_after=breaks_after))
        assert marker.exists()
        assert bad[0] in [p.name for p in read_manifest(str(tmp_path / "bad.csv"))]
    with RunJournal(path, {"a": 1}) as book:
        run = Run(book, tmp_path / "bad.csv")
        executor = reading()
        run.work(PARTS, JOB, executor)
    assert executor.read == ["p0"]
    assert (run.read_now, run.summary.parts, run.summary.errors) == (1, 6, 2)
    assert not marker.exists()
    rows = csv_rows(path)
    assert [row["part"] for row in rows] == [p.name for p in PARTS]
    assert rows[5]["error"] == "p5.npz: its worker is lost; try it alone"
    # the list of bad parts is a manifest
    assert [p.name for p in read_manifest(str(tmp_path / "bad.csv"))] == ["p1", "p5"]


def test_a_run_that_has_read_all_its_parts_ends_without_a_worker(
    flat: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = RunOptions(out=str(flat.with_name("rows.csv")))
    with monkeypatch.context() as patch:
        patch.setattr("pipeline.runs.run.export", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            run_batch([str(flat)], JOB.settings, options, Executor())
    idle = reading()
    run_batch([str(flat)], JOB.settings, options, idle)
    assert idle.read == []
    assert len(read_rows(flat.with_name("rows.csv"))) == 1


@pytest.mark.parametrize("edited", ["manifest.csv", "expected.csv", "order.txt"])
def test_a_run_does_not_go_on_with_a_table_that_was_edited(
    edited: str, flat: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parts from before and after the edit do not belong in one table."""
    monkeypatch.chdir(flat.parent)
    tables = {
        "manifest.csv": "part,height_map\nb,a.npz\n",
        "expected.csv": "part,text\nb,AB12\n",
        "order.txt": "AB12\n",
    }
    for name, text in tables.items():
        Path(name).write_text(text, encoding="utf-8")

    def run() -> None:
        options = RunOptions(out="rows.csv", verify="expected.csv", order=Path("order.txt"))
        run_batch(["manifest.csv"], JOB.settings, options, Executor())

    with monkeypatch.context() as patch:
        patch.setattr("pipeline.runs.run.export", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            run()
    Path(edited).write_text(tables[edited].replace("b,", "c,").replace("AB12\n", "AB13\n"), encoding="utf-8")
    with pytest.raises(FileError, match=rf"holds another run \(tables\.{edited} was"):
        run()
    Path(edited).write_text(tables[edited], encoding="utf-8")
    run()
    assert [row.part for row in read_rows(Path("rows.csv"))] == ["b"]


def test_a_format_that_cannot_be_is_the_parts_own_error(flat: Path) -> None:
    for setting in ({"format": "re:["}, {"font": "nosuchfont"}):
        read = read_listed(JOB, PartFiles("a", str(flat), **setting))
        assert "correct its format or font in the manifest" in read.record.error, read.record.error
    read = read_listed(JOB, PartFiles("a", str(flat)))
    assert (read.record.error, read.record.decision) == ("", "reject")


def test_a_text_expected_that_the_format_forbids_is_told(flat: Path) -> None:
    listed = PartFiles("a", str(flat), expected="A1", format="99")
    assert "text expected of a: is 'A1', but it does not fit" in read_listed(JOB, listed).record.error
    noted = read_listed(PartJob(settings=JOB.settings, verify=True), PartFiles("a", str(flat)))
    assert "not verified" in noted.record.messages[-1]


def test_files_of_the_settings_travel_with_the_order(tmp_path: Path) -> None:
    lexicon = tmp_path / "known.txt"
    lexicon.write_text("AB12\n")
    settings = ReadSettings(lexicon=lexicon, font=("gothic",))
    sent = files_to_send(settings)
    lexicon.unlink()  # as on another machine
    there = with_local_files(settings, sent)
    assert there.lexicon is not None
    assert (there.lexicon.read_text(), there.lexicon.name, there.font) == ("AB12\n", "known.txt", ("gothic",))
    assert with_local_files(settings, sent) == there
    assert with_local_files(settings, {}) is settings
    with pytest.raises(FileError, match=r"known\.txt"):
        files_to_send(settings)


def test_pictures_go_with_a_store_alone() -> None:
    with pytest.raises(SettingsError, match="--evidence goes with a store"):
        RunOptions(out="rows.csv", evidence=Path("evidence")).check()
    RunOptions(out="sqlite:///parts.db", evidence=Path("evidence")).check()


@pytest.mark.usefixtures("_in_folder")
@pytest.mark.parametrize("moment", ["the workers end", "it has ended"])
def test_a_run_into_a_store_that_is_killed_as_it_ends_reads_nothing_into_it_twice(
    moment: str, tmp_path: Path
) -> None:
    options, described = RunOptions(out="sqlite:///parts.db"), {"inputs": ["a"]}

    def killed() -> None:
        with open_run(options, described) as run:
            run.work(PARTS, JOB, reading())
            if moment == "the workers end":
                raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        killed()
    store = Store.open("sqlite:///parts.db")
    store.forget_keys(datetime.now(UTC) + timedelta(days=1))  # those of requests alone
    store.close()
    with open_run(options, described) as run:
        run.work(PARTS, JOB, reading())
    assert run.known == (len(PARTS) if moment == "it has ended" else 0)
    with sa.create_engine("sqlite:///parts.db").connect() as connection:
        names = [
            row.name
            for row in connection.execute(
                sa.text("select record ->> '$.name' as name from parts order by name")
            )
        ]
    assert names == [part.name for part in PARTS]
    assert not list(tmp_path.glob("tactile-marks-*"))


@pytest.mark.usefixtures("_in_folder")
def test_the_rows_of_a_run_into_a_store_are_its_owners_alone(tmp_path: Path) -> None:
    with open_run(RunOptions(out="sqlite:///parts.db"), {}):
        journals = list(tmp_path.glob("tactile-marks-*"))
        assert ".unfinished" in {path.suffix for path in journals}
        assert {path.stat().st_mode & 0o777 for path in journals} == {0o600}


@pytest.mark.usefixtures("_in_folder")
def test_a_part_that_no_store_holds_is_an_error_and_no_end() -> None:
    listed = [PartFiles("long", "a.npz", expected="A" * 300), PartFiles("odd \udcff", "b.npz"), PARTS[0]]

    with open_run(RunOptions(out="sqlite:///parts.db"), {}) as run:
        run.work(listed, JOB, reading(text=lambda _: "A1"))
    assert (run.summary.errors, run.summary.decisions["accept"]) == (1, 2)
    with sa.create_engine("sqlite:///parts.db").connect() as connection:
        names = {
            row.name for row in connection.execute(sa.text("select record ->> '$.name' as name from parts"))
        }
    assert names == {"odd \\udcff", "p0"}


def test_pictures_are_of_all_that_a_person_is_to_review(tmp_path: Path) -> None:
    """A part that is read with certainty, and bears another text than expected, is to be reviewed."""
    part = tmp_path / "part"
    write_part(SynthSpec(format="A9", seed=3, height_mm=4.0, variation=False), part, 0, photos=False)
    settings = ReadSettings(font=("gothic",), format=("A9",), height_mm=4.0)
    job = PartJob(settings=settings, wants=Wants(pictures="review"))
    plain = read_listed(job, PartFiles("a", f"{part}.npz"))
    assert (plain.record.decision, plain.pictures) == ("accept", ())
    wrong = "Z9" if plain.record.text != "Z9" else "Y8"
    refuted = read_listed(job, PartFiles("a", f"{part}.npz", expected=wrong))
    assert refuted.record.verdict == "refuted"
    assert [p.kind for p in refuted.pictures] == [EvidenceKind.EDGES_PICTURE]
    assert refuted.pictures[0].content.startswith(b"\xff\xd8")


ROWS = {"p0": "T0", "p1": "T2", "p2": "T 2", "p3": "T3", "p4": "T4", "p5": "T2"}


@pytest.mark.parametrize("breaks_after", [1, 3, 5, 99])
@pytest.mark.parametrize("parts", [PARTS, PARTS[::-1], PARTS[3:] + PARTS[:3]])
@pytest.mark.parametrize("table", ["rows.csv", None])
def test_parts_with_one_serial_all_go_to_review(
    tmp_path: Path, breaks_after: int, parts: list[PartFiles], table: str | None
) -> None:
    """In whatever order they are read, and wherever the run was interrupted."""
    options = RunOptions(out=None if table is None else str(tmp_path / table))
    rules = SerialRules(duplicates=True, order=ProductionOrder("lot-7.csv", frozenset({"T0", "T2", "T4"})))
    for ends in (breaks_after, 99):
        rows = dict[str, Any]()
        with open_run(options, {}) as run, contextlib.suppress(KeyboardInterrupt):
            run.rules = rules
            run.on_row = lambda row, rows=rows: rows.__setitem__(row.part, row)
            run.work(parts, JOB, reading(text=lambda p: ROWS[p.name], breaks_after=ends))
    decisions = {name: row.decision for name, row in rows.items()}
    assert decisions == {name: "accept" if name in ("p0", "p4") else "review" for name in ROWS}
    assert rows["p3"].messages == ("T3 is not in lot-7.csv",)
    alarms = {(*row.messages, row.reasons[-1].code) for name, row in rows.items() if name in ("p1", "p2")}
    names = [part.name for part in parts if part.name in ("p1", "p2", "p5")]
    assert alarms == {
        (f"{ROWS[name]} was also read on {', '.join(n for n in names if n != name)}", "read_before")
        for name in ("p1", "p2")
    }
    if table is not None:
        assert {row.part: row.decision for row in read_rows(tmp_path / table)} == decisions


def test_a_run_that_continues_compares_the_parts_from_before_with_the_certificate(tmp_path: Path) -> None:
    """The few parts that are left would be too few to show that they are of another kind."""
    parts = [PartFiles(f"p{k:02d}", f"p{k:02d}.npz") for k in range(EVERY + 2)]
    rough = dict(zip([part.name for part in parts], measured(len(parts), rough_um=5.0), strict=True))

    def answer(part: PartFiles, _: PartJob) -> ReadPart:
        return ReadPart((record(part, "T1"),), measures=rough[part.name])

    for ends, left in ((EVERY - 1, ""), (99, "unlike the certified ones")):
        watch = DriftWatch(a_certificate())
        with open_run(RunOptions(out=str(tmp_path / "rows.csv")), {}) as run:
            run.watch = watch
            with contextlib.suppress(KeyboardInterrupt):
                run.work(parts, JOB, FakeExecutor(answer, breaks_after=ends))
        watch.compare()
        assert left in watch.first
        assert bool(left) == bool(watch.first)
    assert run.read_now == 3


def test_repeated_serials_are_accepted_if_they_may_repeat(tmp_path: Path) -> None:
    with open_run(RunOptions(out=str(tmp_path / "rows.csv")), {}) as run:
        run.rules = SerialRules()
        run.work(PARTS, JOB, reading(text=lambda _: "T2"))
    assert {row.decision for row in read_rows(tmp_path / "rows.csv")} == {"accept"}


@pytest.mark.usefixtures("_in_folder")
def test_parts_with_one_serial_go_to_review_in_the_store_too() -> None:
    """A person's review stands, also if the run is given again."""
    options, texts = RunOptions(out="sqlite:///parts.db"), dict.fromkeys(("p1", "p4"), "T2")

    def run_once(breaks_after: int = 99) -> dict[str, Any]:
        with open_run(options, {}) as run, contextlib.suppress(KeyboardInterrupt):
            run.rules = SerialRules(duplicates=True)
            work = reading(text=lambda p: texts.get(p.name, p.name), breaks_after=breaks_after)
            run.work(PARTS, JOB, work)
        with contextlib.closing(Store.open("sqlite:///parts.db")) as store:
            return {part.name: part for part in store.parts()}

    run_once(breaks_after=4)
    stored = run_once()
    assert {name for name, part in stored.items() if part.state.value == "review"} == {"p1", "p4"}
    assert stored["p4"].reading.messages[-1] == "T2 was also read on p1"
    with contextlib.closing(Store.open("sqlite:///parts.db")) as store:
        store.review(stored["p1"].id, person=Person("Ada"), action=ReviewAction.CONFIRM)
    assert {part.state.value for part in run_once().values()} == {"accepted", "reviewed", "review"}


GOTHIC, TIMES = load_font("gothic"), load_font("timesr")


@dataclass(frozen=True)
class Read:
    part: str
    text: str
    decision: str = "accept"
    confidence: float = 0.95
    error: str = ""


def texts(n: int) -> list[Read]:
    rng = np.random.default_rng(1)
    letters = list("ABCDEFGH0123456789")
    return [
        Read(f"p{k:03d}", "".join(rng.choice(letters, 8)), confidence=round(float(rng.uniform(0.9, 1.0)), 2))
        for k in range(n)
    ]


def learned(parts: list[tuple[str, str]]) -> Learned:
    """Of parts (stamped, as read)."""
    chars = [char for _, read in parts for char in read]
    reliefs = [blow(char, 10 * k, GOTHIC) for k, (stamped, _) in enumerate(parts) for char in stamped]
    return learn_font("lot-die", chars, reliefs, known=(TIMES,), vouching=False)


# ---------------------------------------------------------------------------------------------------- who teaches


def test_the_order_of_the_parts_makes_no_difference() -> None:
    lot = texts(200)
    assert teachers(lot) == teachers(lot[::-1]) == teachers(lot[77:] + lot[:77])


def test_only_what_was_accepted_teaches_and_the_surest_first() -> None:
    lot = [
        Read("unsure", "ABCD", "review", 0.99),
        Read("bad", "ABCD", "accept", 0.99, error="cannot be read"),
        *(Read(f"late{k}", "EFGH", confidence=0.91) for k in range(EXEMPLARS_EACH)),
        *(Read(f"sure{k}", "EFGH", confidence=0.99) for k in range(EXEMPLARS_EACH)),
        Read("rare", "E F9", confidence=0.9),
    ]
    chosen = teachers(lot)
    assert [*chosen] == ["rare", *(f"sure{k}" for k in range(EXEMPLARS_EACH))]
    assert chosen["rare"] == "EF9"


def test_every_character_gets_its_exemplars_and_no_more_parts_than_that_takes() -> None:
    chosen = teachers(texts(400))
    assert len(chosen) <= MOST_TEACHERS
    assert min(Counter("".join(chosen.values())).values()) >= EXEMPLARS_EACH


def test_nobody_teaches_where_nothing_was_accepted() -> None:
    assert teachers([replace(outline, decision="review") for outline in texts(30)]) == {}


# --------------------------------------------------------------------------------- what a second reading may change


@pytest.mark.parametrize(
    ("first", "second", "better"),
    [
        (Read("a", "AB12"), Read("a", "AB17", "accept", 0.99), False),  # an accepted part never changes
        (Read("a", "AB12"), Read("a", "AB12", "accept", 0.99), False),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB17", "accept", 0.95), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB12", "review", 0.8), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB12", "review", 0.5), False),
        (Read("a", "AB12", "review", 0.6), Read("a", "AB17", "review", 0.8), False),
        (Read("a", "", "reject", 0.0), Read("a", "AB12", "accept", 0.95), True),
        (Read("a", "AB12", "review", 0.6), Read("a", "", "", 0.0, "its worker is lost"), False),
        (Read("a", "", "", 0.0, "cannot be read"), Read("a", "AB12", "accept", 0.95), False),
    ],
)
def test_a_second_reading_counts_where_it_is_accepted_or_surer(
    first: Read, second: Read, better: bool
) -> None:
    assert is_better(second, first) is better
    assert needs_another(first) or not better


def test_what_counts_counts_for_good() -> None:
    """Asked again of the reading that was taken, as a run taken up again asks, nothing changes."""
    second = Read("a", "AB12", "review", 0.8)
    assert not is_better(second, second)


# -------------------------------------------------------------------------------------- a wrong reading teaches nobody


def test_fewer_than_three_that_agree_teach_nothing() -> None:
    """Two of M, three of W of which one is an H: neither is of the die, and readings with them are doubted."""
    database = learned([*[("K7B2", "K7B2")] * 4, ("MW", "MW"), ("MW", "MW"), ("H", "W")])
    assert {char for char, used in database.used.items() if used} == set("K7B2")
    assert database.font.glyphs["M"].guessed
    assert database.font.glyphs["W"].guessed
    assert not database.font.glyphs["K"].guessed


def test_a_lot_of_which_no_character_is_sure_teaches_nothing() -> None:
    with pytest.raises(ExemplarError, match="no character has 3 exemplars that agree"):
        learned([("K7B2", "K7B2")] * 2)


def test_parts_of_two_dies_do_not_agree() -> None:
    text = "K7B2"
    assert agreement(text * 8, learned([(text, text)] * 8).used) == 1.0
    reliefs = [blow(c, 10 * k, font) for k, font in enumerate([GOTHIC, TIMES] * 4) for c in text]
    mixed = learn_font("lot-die", text * 8, reliefs, known=(TIMES,), vouching=False)
    assert agreement(text * 8, mixed.used) < LEAST_AGREEMENT
