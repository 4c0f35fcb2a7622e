"""The table of a run: what is kept of it whatever ends the program, and what it costs."""

from __future__ import annotations

import csv
import io
import json
import os
import resource
import sqlite3
import tracemalloc
from collections.abc import Callable, Iterable, Sequence
from dataclasses import is_dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pyarrow.parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord, RivalRecord
from pipeline.common.row import row_of
from pipeline.common.texts import csv_line, unescape_formula
from pipeline.reading.triage import ReadPart
from pipeline.runs.outputs import RunJournal, export
from pipeline.runs.tables import MOST_TEXT
from tests.support.run_tables import TableRow, csv_rows, read_rows, record_of, record_of_json, write_records

SUFFIXES = (".csv", ".jsonl", ".parquet")
RUN = {"font": "gothic", "formats": ["AA99"], "depth_mm": 0.3}

NASTY = (
    'a,"b"',
    "two\r\nlines",
    '"',
    "\n",
    "\x00",
    "\udcff\ud800",
    r"\udcff \u005c \u0000 \n",
    "ü\u2028\x85",
    "",
)
ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=12) | st.sampled_from(NASTY)
NUMBERS = st.floats(-1e300, 1e300)  # their mean is a number, too
TIMES = st.datetimes(timezones=st.just(UTC))


def any_record(text: st.SearchStrategy[str], kind: Any = ReadingRecord) -> st.SearchStrategy[Any]:
    """Records, or other values of their fields, of whatever their types allow."""
    parts = get_args(kind)
    if get_origin(kind) is UnionType:
        return st.none() | any_record(text, parts[0])
    if get_origin(kind) is tuple and parts[-1] is Ellipsis:
        return st.lists(any_record(text, parts[0]), max_size=2).map(tuple)
    if get_origin(kind) is tuple:
        return st.tuples(*(any_record(text, part) for part in parts))
    if not is_dataclass(kind):
        return {str: text, float: NUMBERS, int: st.integers(-999, 999), bool: st.booleans(), datetime: TIMES}[
            kind
        ]
    of_words: dict[Any, dict[str, st.SearchStrategy[Any]]] = {
        CandidateRecord: {"char": text.filter(bool)},
        CharacterRecord: {"action": st.sampled_from(("", "clean", "re-strike")), "depth_mean_mm": NUMBERS},
    }
    fields = {name: any_record(text, hint) for name, hint in get_type_hints(kind).items()}
    return st.builds(kind, **{**fields, **of_words.get(kind, {})})


def row(name: str, **more: Any) -> ReadingRecord:
    if "grade" in more:
        more["characters"] = (CharacterRecord((), None, grade=more.pop("grade")),)
    return ReadingRecord("tactile", "AB12", "accept", 0.97, part=name, seconds=0.25, font="gothic", **more)


def rows_of(n: int) -> list[ReadingRecord]:
    return [row(f"part-{i}") for i in range(n)]


def names(rows: Iterable[TableRow | ReadingRecord]) -> list[str]:
    return [r.part for r in rows]


def add(book: RunJournal, record: ReadingRecord) -> None:
    book.keep(record.part, ReadPart((record,)))


def begun(table: Path, rows: Sequence[ReadingRecord]) -> Path:
    """A run that broke off."""
    with RunJournal(table, RUN) as book:
        for r in rows:
            add(book, r)
    return table


@pytest.fixture(params=SUFFIXES)
def table(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return tmp_path / f"rows{request.param}"


@pytest.fixture
def _no_sync(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that open hundreds of books: what the disk was made to write no test can see."""
    monkeypatch.setattr("os.fsync", lambda _: None)


# --------------------------------------------------------------------------------------------------- whole runs


def test_a_run_ends_in_order_and_leaves_just_its_table(table: Path) -> None:
    rows = rows_of(5)
    with RunJournal(table, RUN) as book:
        assert (book.resumed, book.previous, set(book.names)) == (False, None, set())
        for i in (3, 0, 4, 1, 2):
            add(book, rows[i])
            assert rows[i].part in book.names
        assert names(book.records()) == ["part-3", "part-0", "part-4", "part-1", "part-2"]
        # part-1 is named twice and part-9 has no row; part-4 is not named and comes last
        export(book, ["part-2", "part-1", "part-9", "part-1", "part-0", "part-3"])
    assert [p.name for p in table.parent.iterdir()] == [table.name]
    assert names(read_rows(table)) == [f"part-{i}" for i in (2, 1, 0, 3, 4)]
    assert table.stat().st_mode & 0o777 == 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


# ------------------------------------------------------------------------------------------------- every field


@pytest.mark.usefixtures("_no_sync")
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(any_record(ANY_TEXT), max_size=4, unique_by=lambda r: r.part))
def test_every_field_comes_back_from_every_file(
    tmp_path_factory: pytest.TempPathFactory, rows: list[ReadingRecord]
) -> None:
    folder = tmp_path_factory.mktemp("rows")
    for suffix in SUFFIXES:
        table = begun(folder / f"t{suffix}", rows)
        with RunJournal(table, RUN) as book:
            assert book.names == set(names(rows))
            assert list(book.records()) == rows
            export(book, reversed(names(rows)))
        read_again = read_rows(table)
        if suffix == ".csv":
            assert [(r.part, r.text) for r in read_again] == [
                (r.part, r.text) for r in map(in_csv, rows[::-1])
            ]
        else:
            assert [record_of(r.columns) for r in read_again] == rows[::-1]
        if suffix != ".parquet":
            table.read_bytes().decode("utf-8")  # strictly


def in_csv(record: ReadingRecord) -> ReadingRecord:
    ((part, text),) = csv.reader(io.StringIO(csv_line((record.part, record.text)), newline=""))
    return replace(record, part=part, text=text)


PLAIN_TEXT = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\x00\\"), max_size=12)


@settings(max_examples=15, deadline=None)
@given(st.lists(any_record(PLAIN_TEXT), max_size=3))
def test_other_programs_read_the_same(
    tmp_path_factory: pytest.TempPathFactory, rows: list[ReadingRecord]
) -> None:
    folder = tmp_path_factory.mktemp("rows")
    for suffix in SUFFIXES:
        write_records(rows, folder / f"t{suffix}")
    assert [
        {name: unescape_formula(cell) for name, cell in row.items()} for row in csv_rows(folder / "t.csv")
    ] == [{name: "" if v is None else str(v) for name, v in row_of(record).items()} for record in rows]
    # `splitlines` takes more for ends of lines than JSON does, as many programs do
    lines = (folder / "t.jsonl").read_text(encoding="utf-8").splitlines()
    assert [record_of_json(line.encode()) for line in lines] == rows
    arrow = pyarrow.parquet.read_table(folder / "t.parquet").to_pylist()
    for line, record, parquet in zip(lines, rows, arrow, strict=True):
        told = json.loads(line)
        assert [*told][:7] == ["part", "text", "decision", "confidence", "source", "seconds", "error"]
        read_at = told.pop("at")
        assert (
            (None if read_at is None else datetime.fromisoformat(read_at)) == parquet.pop("at") == record.at
        )
        assert told == parquet
        assert (told["text"], told["messages"]) == (record.text, list(record.messages))
        for place, cell in zip(record.characters, told["characters"], strict=True):
            best = [cell, *cell["alternatives"]] if place.candidates else []
            assert [(c["char"], c["probability"], c["score"]) for c in best] == [
                (c.char, c.probability, c.score) for c in place.candidates
            ]
            assert tuple(cell["box_mm"] or ()) == (place.box_mm or ())
            assert (cell["depth_min_mm"], cell["grade"]) == (place.depth_min_mm, place.grade)


@pytest.mark.parametrize(
    "wrong",
    [
        {"confidence": float("nan")},
        {"height_mm": float("inf")},
        {"messages": ("x" * (MOST_TEXT + 1),)},
        {"error": "\x00" * (MOST_TEXT // 6 + 1)},
    ],
)
def test_a_record_that_no_table_holds_is_an_error_and_harms_none(wrong: dict[str, Any], table: Path) -> None:
    with RunJournal(table, RUN) as book:
        for record in (row("a"), replace(row("bad"), **wrong), row("b")):
            add(book, record)
        export(book, [])
    told = read_rows(table)
    assert names(told) == ["a", "bad", "b"]
    assert [r.part for r in told if "please report it" in r.error] == ["bad"]


# -------------------------------------------------------------------------------------------------- broken off


@pytest.mark.parametrize("suffix", [".csv", ".jsonl"])
@pytest.mark.parametrize("harm", [lambda whole: whole[:-5], lambda whole: whole + b'"', lambda _: None])
def test_a_table_that_was_harmed_is_written_anew_from_the_journal(
    harm: Callable[[bytes], bytes | None], suffix: str, tmp_path: Path
) -> None:
    table = begun(tmp_path / f"t{suffix}", [row("p0"), row("p1", messages=('a "q",\r\n b\n',))])
    whole = table.read_bytes()
    table.unlink()
    if (harmed := harm(whole)) is not None:
        table.write_bytes(harmed)
    with RunJournal(table, RUN) as book:
        assert table.read_bytes() == whole
        add(book, row("p3"))
        assert names(read_rows(table)) == ["p0", "p1", "p3"]


# ----------------------------------------------------------------------------------------------- whose table it is


def test_a_finished_table_is_kept(table: Path) -> None:
    older = table.with_name(table.name + "~")
    for run in range(3):
        with RunJournal(table, RUN) as book:
            assert not book.resumed
            assert book.previous == (older if run else None)
            add(book, row(f"run-{run}"))
            export(book, [])
        assert names(read_rows(table)) == [f"run-{run}"]
        if run:
            old = older.rename(table.with_name("old" + table.suffix))
            assert names(read_rows(old)) == [f"run-{run - 1}"]


def test_another_run_is_told_and_leaves_all_as_it_was(table: Path) -> None:
    begun(table, rows_of(2))
    before = table.read_bytes() if table.exists() else b""
    other = {**RUN, "font": "roman", "lexicon": "x" * 200}
    with pytest.raises(FileError, match="holds another run") as caught:
        RunJournal(table, other)
    assert 'font was "gothic", now "roman"; lexicon was not set, now "xxx' in str(caught.value)
    assert f"name another one, or remove {table.name}.unfinished to start again" in str(caught.value)
    assert "depth_mm" not in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(table))
    assert (table.read_bytes() if table.exists() else b"") == before
    # the order of the entries is no matter, nor are tuples for lists
    with RunJournal(table, {"depth_mm": 0.3, "formats": ("AA99",), "font": "gothic"}) as book:
        assert book.resumed
    # as told
    table.with_name(table.name + ".unfinished").unlink()
    with RunJournal(table, other) as book:
        assert not book.resumed
        assert book.previous == (None if table.suffix == ".parquet" else table.with_name(table.name + "~"))
        assert set(book.names) == set()


def test_a_run_that_ends_while_the_next_begins_does_not_share_its_lock(
    table: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one before removes its journal after the next has opened it and before it has locked it."""
    marker, real, calls = table.with_name(table.name + ".unfinished"), sqlite3.connect, list[Path]()

    def connected_late(path: Path, **how: Any) -> sqlite3.Connection:
        calls.append(path)
        connection = real(path, **how)
        if len(calls) == 1:
            marker.unlink()
        return connection

    monkeypatch.setattr("sqlite3.connect", connected_late)
    with RunJournal(table, RUN):
        assert len(calls) == 2
        assert marker.exists()
        with pytest.raises(FileError, match="is being written by another run"):
            RunJournal(table, RUN)


@pytest.mark.parametrize("text", ["[]" * 2000, "SQLite format 3\x00" * 300])
def test_a_damaged_journal_is_told_and_the_table_stays(text: str, table: Path) -> None:
    begun(table, rows_of(2))
    before = table.read_bytes() if table.exists() else b""
    table.with_name(table.name + ".unfinished").write_text(text)
    with pytest.raises(FileError, match=r"has a damaged journal .*; name another one, or remove"):
        RunJournal(table, RUN)
    assert (table.read_bytes() if table.exists() else b"") == before


def test_a_journal_of_another_version_is_told(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun(table, rows_of(2))
    monkeypatch.setattr(RunJournal, "version", 99)
    with pytest.raises(
        FileError, match=r"is the journal of a run, version 6, not of a run, version 99; name another one"
    ):
        RunJournal(table, RUN)


def test_places_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.csv, \.jsonl, \.parquet"):
        RunJournal(tmp_path / "t.ods", RUN)
    with pytest.raises(FileError, match="cannot be written"):
        RunJournal(tmp_path / "none" / "t.csv", RUN)
    (tmp_path / "t.csv").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        RunJournal(tmp_path / "t.csv", RUN)
    (tmp_path / "u.csv.unfinished").mkdir()
    with pytest.raises(FileError, match=r"cannot be written .*check the disk"):
        RunJournal(tmp_path / "u.csv", RUN)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.csv", "u.csv.unfinished"]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_full_disk_is_told_and_the_rows_before_it_stay_whole(suffix: str, tmp_path: Path) -> None:
    table, (soft, hard) = tmp_path / f"rows{suffix}", resource.getrlimit(resource.RLIMIT_FSIZE)
    parts_kept: list[str] = []
    with RunJournal(table, RUN) as book:
        resource.setrlimit(
            resource.RLIMIT_FSIZE, (100_000, hard)
        )  # a write over it is done in part, then refused
        try:
            with pytest.raises(FileError, match=r"cannot be written \(.*and start the same command again$"):  # noqa: PT012
                for r in rows_of(1000):
                    add(book, r)
                    parts_kept.append(r.part)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(parts_kept) > 5
    with RunJournal(table, RUN) as book:
        assert book.names >= set(parts_kept)
        export(book, [])
    assert names(read_rows(table))[: len(parts_kept)] == parts_kept


# ------------------------------------------------------------------------------------------------------ memory


def _peak(call: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _finish_peak(table: Path, n: int) -> int:
    """Bytes that it takes at most to put n rows in order."""
    with RunJournal(table, RUN) as book:
        for i in range(n):
            add(
                book,
                row(
                    f"part-{i}",
                    rivals=(RivalRecord(f"AB{i}", 0.02), RivalRecord(f"AC{i}", 0.01)),
                    messages=(40 * "flag ",),
                ),
            )
        order = [f"part-{i}" for i in np.random.default_rng(6).permutation(n)]
        assert sum(1 for _ in book.records()) == n  # what libraries keep: pydantic has a cache of texts
        return _peak(lambda: export(book, order))


@pytest.mark.usefixtures("_no_sync")
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_memory_does_not_grow_with_the_rows(suffix: str, tmp_path: Path) -> None:
    table = tmp_path / f"rows{suffix}"
    few, many = 1_000, 2_500
    write_records(rows_of(1), table)  # whatever libraries load, once
    # Buffers of files, and a record; of Parquet a group of 500 rows of some 5 kB each while they are turned into
    # columns. All rows of the larger table as objects would take 4 MB, and 20 on their way into columns.
    fixed_bytes = 3_500_000 if table.suffix == ".parquet" else 400_000
    # the order is SQLite's
    row_bytes = 5
    finish_few, finish_many = _finish_peak(table, few), _finish_peak(table, many)
    assert finish_many < fixed_bytes + row_bytes * many
    # a group of 500 rows takes a little more where its numbers are longer
    assert finish_many - finish_few < row_bytes * (many - few) + fixed_bytes / 10
