"""The journal of a run: the result of each finished part, in an SQLite file. The same command continues the run."""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

from pydantic import ConfigDict, TypeAdapter

from glyphs.atomic import sync_names
from glyphs.errors import FileError
from pipeline.common.version import differences, key_of
from pipeline.workers.executors import Executor

Stored = TypeVar("Stored")
O = TypeVar("O")  # noqa: E741 - an order
T = TypeVar("T")
R = TypeVar("R")

_TABLES = """
create table if not exists run (kind text, version integer, description text);
create table if not exists parts
    (number integer primary key, name blob, again integer, kept text{facts}, unique (name, again));
"""
_IN_ORDER = """
select {columns} from parts first left join parts second on second.name = first.name and second.again = 1
left join temp.asked on asked.name = first.name
where first.again = 0 order by asked.rowid is null, asked.rowid, first.number
"""
_MOST_TOGETHER = 64
_SYNC_S = 1.0  # a power failure loses the parts of the last second, at most
_DAMAGED = (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT)


class Journal(Generic[Stored]):
    """Stored results of the parts of one run, for one process at a time. Methods that write raise FileError."""

    kind: ClassVar[str]  # of run, in one word
    version: ClassVar[int] = 1
    keeps: ClassVar[Any]  # type stored for a part; pydantic writes and reads it
    facts: ClassVar[tuple[str, ...]] = ()  # columns beside it, which can be read without it; see `facts_of`
    # name in the folder of its run; empty if the place of the run is the journal itself
    file: ClassVar[str] = ""

    def __init__(
        self, place: Path, description: Mapping[str, Any] | None, *, output: Path | None = None
    ) -> None:
        """Resume the journal, a file or in the folder of the run, or begin a new one; without a description, read any.
        Raises FileError, which names the `output` (default: the journal): it is of another run, or in use."""
        self.path = place / self.file if self.file else place
        self._output = output or self.path
        # a dataclass takes no configuration, a union with it does
        self._adapter: TypeAdapter[Stored] = TypeAdapter(
            self.keeps | None, config=ConfigDict(ser_json_inf_nan="constants")
        )
        self._synced_s = time.monotonic()
        with self._faults():
            if self.file:
                place.mkdir(parents=True, exist_ok=True)
            if description is None and not os.access(self.path, os.W_OK):
                self._db = sqlite3.connect(f"{self.path.absolute().as_uri()}?immutable=1", uri=True)
            else:
                self._db = self._open()
        try:
            with self._faults():
                held = self._stored_description()
                self.resumed = held is not None
                if held is None and description is None:
                    raise self._unusable(f"is not a journal of a {self.kind}")
                self.description = dict(held if description is None else description)  # type: ignore[arg-type]
                if held is None:
                    self._begin()
                elif key_of(held) != key_of(self.description):
                    what = f"holds another {self.kind} ({differences(held, self.description)})"
                    raise self._unusable(what, f"name another one, or remove {self.path.name} to start again")
                rows = self._db.execute("select name, again from parts").fetchall()
                self.names = {as_text(name) for name, again in rows if not again}
                self.again = {as_text(name) for name, again in rows if again}
        except BaseException:
            self.close()
            raise

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the journal in a folder, and close it. Raises FileError: there is no journal."""
        path = folder / cls.file
        if not path.is_file():
            raise FileError(path, "is not there", f"name the folder of a {cls.kind} (--out)")
        with cls(folder, None) as journal:
            journal.done  # noqa: B018 - read while it is open
        return journal

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @cached_property
    def done(self) -> dict[str, Stored]:
        rows = self._db.execute("select name, kept from parts where again = 0 order by number")
        return {as_text(name): self.parse(text) for name, text in rows}

    def keep(self, name: str, result: Stored, *, again: bool = False) -> Stored:
        """Store the result of a part, or a second one beside it (`again`), and return it; the last of each counts."""
        return self.keep_all({name: result}, again=again)[name]

    def keep_all(self, results: Mapping[str, Stored], *, again: bool = False) -> Mapping[str, Stored]:
        """Store the results of several parts, by name, and return them; a kill leaves all of them stored, or none."""
        columns = ("name", "again", "kept", *self.facts)
        marks = f"({', '.join('?' * len(columns))})"
        changed = ", ".join(f"{column} = excluded.{column}" for column in columns[2:])
        statement = (
            f"insert into parts ({', '.join(columns)}) values {', '.join([marks] * len(results))}"
            f" on conflict (name, again) do update set {changed}"
        )
        with self._faults():
            rows = (
                (as_blob(n), again, self._text(value), *self.facts_of(n, value))
                for n, value in results.items()
            )
            # one statement stores all of them or none
            self._write(statement, [*chain(*rows)], synced=time.monotonic() >= self._synced_s + _SYNC_S)
        (self.again if again else self.names).update(results)
        if not again and "done" in vars(self):
            self.done.update(results)
        return results

    def facts_of(self, name: str, result: Stored) -> Sequence[Any]:
        return ()

    def rows(self, *columns: str, order: Iterable[str] = ()) -> Iterator[tuple[Any, ...]]:
        """Stream columns (name, kept, facts) of every part's first result and its second, those of `order` first."""
        with self._faults():
            self._db.execute("create table if not exists temp.asked (name blob unique)")
            self._db.execute("delete from temp.asked")
            names = ((as_blob(name),) for name in order)
            self._db.executemany("insert or ignore into temp.asked values (?)", names)
        selected = ", ".join(f"{reading}.{column}" for reading in ("first", "second") for column in columns)
        yield from self._db.execute(_IN_ORDER.format(columns=selected))

    def latest(self, count: int) -> list[Stored]:
        rows = self._db.execute(
            "select kept from parts where again = 0 order by number desc limit ?", (count,)
        ).fetchall()
        return [self.parse(text) for (text,) in reversed(rows)]

    def close(self) -> None:
        with contextlib.suppress(sqlite3.Error):
            # the closed file can be copied and read anywhere
            self._db.execute("pragma journal_mode = delete")
        self._db.close()

    def remove(self) -> None:
        self.close()
        with self._faults():
            sync_names(self.path.parent)
            self.path.unlink()

    def _open(self) -> sqlite3.Connection:
        while True:
            self.path.touch()
            before = self.path.stat()
            db = sqlite3.connect(self.path, timeout=0.0, isolation_level=None)
            try:
                db.execute("pragma locking_mode = exclusive")
                db.execute("pragma journal_mode = wal")
                db.execute("pragma synchronous = normal")
                db.execute("pragma wal_autocheckpoint = 10000")  # each waits for the disk
                db.execute("select * from sqlite_schema").fetchall()  # takes the lock
                if self._is(before):
                    return db
            except BaseException as error:
                db.close()
                if self._is(before) or not isinstance(error, sqlite3.Error):
                    raise
            db.close()  # the previous run removed it when it ended

    def _is(self, before: os.stat_result) -> bool:
        with contextlib.suppress(FileNotFoundError):
            return os.path.samestat(before, self.path.stat())
        return False

    def _stored_description(self) -> dict[str, Any] | None:
        if not self._db.execute("select 1 from sqlite_schema where name = 'run'").fetchone():
            return None
        row = self._db.execute("select kind, version, description from run").fetchone()
        if row is not None and row[:2] != (self.kind, self.version):
            what = f"is the journal of a {row[0]}, version {row[1]}, not of a {self.kind}, version {self.version}"
            raise self._unusable(what)
        return None if row is None else json.loads(row[2])

    def _begin(self) -> None:
        self._db.executescript(_TABLES.format(facts="".join(f", {name}" for name in self.facts)))
        run = (self.kind, self.version, json.dumps(self.description))
        # the output may still be that of the previous run: this line must be on the disk before any row
        self._write("insert into run values (?, ?, ?)", run, synced=True)
        sync_names(self.path.parent)

    def _write(self, statement: str, values: Sequence[Any], *, synced: bool) -> None:
        if synced:
            self._db.execute("pragma synchronous = full")
        self._db.execute(statement, values)
        if synced:
            self._db.execute("pragma synchronous = normal")
            self._synced_s = time.monotonic()

    def _text(self, result: Stored) -> str:
        try:
            return self._adapter.dump_json(result, exclude_defaults=True).decode()
        except ValueError:  # lone surrogates, which file names may hold: only Python's own JSON writes them
            return json.dumps(self._adapter.dump_python(result, mode="json", exclude_defaults=True))

    def parse(self, text: str) -> Stored:
        try:
            return self._adapter.validate_json(text)
        except ValueError:  # likewise
            return self._adapter.validate_python(json.loads(text))

    def _unusable(self, what: str, hint: str = "") -> FileError:
        return FileError(self._output, what, hint or f"name another one, or remove {self.path.name}")

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            if code == sqlite3.SQLITE_BUSY:
                raise FileError(
                    self._output, "is being written by another run", "wait for it or name another file"
                ) from error
            if code in _DAMAGED:
                raise self._unusable(f"has a damaged journal ({error})") from error
            raise _cannot_be_written(self._output, error) from error


def resumable(
    journal: Journal[Stored],
    parts: Iterable[T],
    executor: Executor,
    work: Callable[[O, T], R],  # makes a result of (order, part)
    order: O,
    *,
    lost: Callable[[T, Exception], R],  # makes that of a part whose work failed or whose worker died
    form: Callable[[T, R], Stored | None] = lambda _, result: result,  # type: ignore[assignment, return-value]
    name: str = "name",
    again: bool = False,
) -> Iterator[tuple[T, Stored]]:
    """Process the parts that the journal lacks, store each result, and yield it; those that arrive together, together.
    Of (part, result) `form` makes what is stored (default: the result itself); None: the part is not done."""
    named, done = attrgetter(name), journal.again if again else journal.names
    tasks: dict[str, T] = {}
    results: dict[str, Stored] = {}
    for outcome in executor.calls(work, order, (p for p in parts if named(p) not in done)):
        task, result = outcome.task, outcome.result
        if outcome.error is not None:
            result = lost(task, outcome.error)
        if (written := form(task, result)) is not None:  # type: ignore[arg-type]
            tasks[named(task)], results[named(task)] = task, written
        if tasks and (not outcome.more or len(tasks) == _MOST_TOGETHER):
            stored = journal.keep_all(results, again=again)
            yield from [(task, stored[name]) for name, task in tasks.items()]
            tasks, results = {}, {}


def set_aside(path: Path, *, head: bytes = b"") -> Path | None:
    """Rename a file of an earlier run to NAME~ and return that name; one with only a header is deleted."""
    if not path.exists() or path.stat().st_size <= len(head):
        path.unlink(missing_ok=True)
        return None
    older = path.with_name(f"{path.name}~")
    os.replace(path, older)
    return older


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Name an output in errors of the disk; the same command resumes the run. Raises FileError: the disk refuses."""
    try:
        yield
    except FileError as problem:
        if not isinstance(problem.__cause__, OSError):
            raise
        raise _cannot_be_written(path, problem.__cause__) from problem
    except OSError as error:
        raise _cannot_be_written(path, error) from error


def _cannot_be_written(path: Path, error: Exception) -> FileError:
    import errno

    full = getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    full = full or getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
    hint = "make room" if full else "check the disk and its permissions"
    why = getattr(error, "strerror", None) or error
    return FileError(path, f"cannot be written ({why})", f"{hint} and start the same command again")


def as_blob(name: str) -> bytes:
    """A text for a column, whatever its characters."""
    return name.encode("utf-8", "surrogatepass")  # a file's name may hold lone surrogates


def as_text(name: bytes) -> str:
    """The text of a column."""
    return name.decode("utf-8", "surrogatepass")
