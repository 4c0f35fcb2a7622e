"""The store's database: opening, upgrade and transactions. SQLite has one writer at a time, taken at the beginning of a
transaction, and every commit is on the disk before it returns. PostgreSQL locks the rows that are read for a change."""

from __future__ import annotations

import contextlib
import functools
import json
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import sqlalchemy as sa
from sqlalchemy import exc
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Row

from glyphs.file_lock import exclusively
from pipeline.common.private import close_to_others, private_file
from pipeline.store.errors import StoreError, UnfitError, UnwritableError, cleaned, fit
from pipeline.store.tables import METADATA

if TYPE_CHECKING:
    from sqlalchemy.engine import URL, Connection, Engine
    from sqlalchemy.engine.interfaces import DBAPIConnection
    from sqlalchemy.pool import ConnectionPoolEntry

MIGRATIONS = Path(__file__).parent / "migrations"
VERSION_TABLE = "tactile_marks_version"
AnyRow = Row[*tuple[Any, ...]]
_WAIT_S = 30.0
_ADVISORY_LOCK = 0x7AC71E
_POOL = 16
# longest wait, s, for the one caller that checks whether a silent server is back
_TURN_S = 1.0
# longest wait, s, of a check for the lock that every write of a part needs
_LOCKED_S = 1.0
_MOST_URL = 5000  # longer than any path of the system
_CHECK = "check that the database runs, that it or its folder is writable, and its address"
_URL_HINT = "write sqlite:///file.db or postgresql://user@host/name"

# Alembic keeps its state in module variables
_migrating = threading.Lock()


class JsonText(str):
    """A value as JSON text that every database can hold, stored unchanged."""


def json_text(value: Any) -> JsonText:
    """Write a value as JSON; characters that databases cannot hold are replaced. Raises UnfitError: it is no JSON."""
    if isinstance(value, JsonText):
        return value
    dumps = functools.partial(json.dumps, allow_nan=False, separators=(",", ":"))
    try:
        text = dumps(value)
        # escapes of NUL and of surrogates; most surrogates are halves of valid characters
        return JsonText(dumps(cleaned(value)) if "\\u0000" in text or "\\ud" in text else text)
    except (TypeError, ValueError) as error:
        raise UnfitError(f"a value cannot be written as JSON ({error})", hint="leave it out") from error


@dataclass(frozen=True)
class Transaction:
    """One transaction of the store; `now` is the time of all that it writes, in UTC."""

    connection: Connection
    now: datetime

    def execute(
        self, statement: sa.Executable, rows: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None
    ) -> sa.CursorResult[*tuple[Any, ...]]:
        """Execute one statement; with rows as separate arguments the compiled statement is reused."""
        return self.connection.execute(statement, rows)

    def count(self, table: sa.Table, *where: sa.ColumnElement[bool]) -> int:
        return int(self.execute(sa.select(sa.func.count()).select_from(table).where(*where)).scalar_one())

    @property
    def postgresql(self) -> bool:
        return self.connection.dialect.name == "postgresql"

    def insert_if_new(self, table: sa.Table, row: Mapping[str, Any]) -> bool:
        insert = postgresql.insert if self.postgresql else sqlite.insert
        statement = insert(table).on_conflict_do_nothing().returning(*table.primary_key)
        return self.execute(statement, row).one_or_none() is not None


def _utc_now() -> datetime:
    return datetime.now(UTC)


class Database:
    """A database that has the tables of this version; threads may share it.

    * All that a read transaction sees is of one moment. A write transaction is undone where its block raises.
    * SQLite: one writer at a time; threads queue here, processes at the file's own lock.
    * While PostgreSQL does not answer, one transaction at a time waits for it, and the others are refused.
    """

    def __init__(self, engine: Engine, shown: str, now: Callable[[], datetime]) -> None:
        self.shown = shown
        self._engine, self._now = engine, now
        # threads queue here, not in SQLite's own wait, which polls and may starve one of many
        self._writer = threading.Lock() if engine.dialect.name == "sqlite" else None
        self._silent, self._asking = False, threading.Lock()
        self.write_failed = False

    @classmethod
    def open(cls, url: str, *, now: Callable[[], datetime] = _utc_now, as_it_is: bool = False) -> Self:
        """Open a database (sqlite:///file.db, postgresql://user:password@host/name) and bring its tables up to date, or
        with `as_it_is` change nothing. Raises StoreError: it cannot be opened, or is of another version."""
        parsed = _checked_url(url)
        shown = parsed.render_as_string(hide_password=True)
        with _store_errors(shown), contextlib.ExitStack() as held:
            if parsed.get_backend_name() == "sqlite":
                if as_it_is and not Path(str(parsed.database)).exists():
                    raise StoreError(
                        f"there is no store {shown}", hint="name the service's --folder or --store"
                    )
                held.enter_context(_file_locked(Path(str(parsed.database))))
            engine = _engine(parsed)
            try:
                _bring_up_to_date(engine, shown, as_it_is=as_it_is)
            except BaseException:
                engine.dispose()
                raise
        return cls(engine, shown, now)

    @contextlib.contextmanager
    def read_transaction(self) -> Iterator[Transaction]:
        """Begin a transaction that changes nothing. Raises StoreError: the database cannot be reached."""
        # SQLite's transactions see one moment anyway
        options = {"isolation_level": "REPEATABLE READ"} if self._writer is None else {}
        with _store_errors(self.shown), self._connect() as connection:
            yield Transaction(connection.execution_options(**options), self._now().astimezone(UTC))

    @contextlib.contextmanager
    def write_transaction(self) -> Iterator[Transaction]:
        """Begin a transaction: the block's end commits it, an exception rolls it back. Raises StoreError: no answer."""
        try:
            with self._write_transaction() as tx:
                yield tx
        except StoreError as error:
            self.write_failed |= type(error) is StoreError  # the others are of what was to be written
            raise
        self.write_failed = False

    @contextlib.contextmanager
    def _write_transaction(self) -> Iterator[Transaction]:
        with _store_errors(self.shown), contextlib.ExitStack() as held:
            if self._writer is not None:
                if not self._writer.acquire(timeout=_WAIT_S):
                    raise StoreError(f"the store {self.shown} is busy", hint="try again")
                held.callback(self._writer.release)
            connection = held.enter_context(self._connect())
            connection = connection.execution_options(tactile_marks_writes=True)
            held.enter_context(connection.begin())
            yield Transaction(connection, self._now().astimezone(UTC))

    @contextlib.contextmanager
    def _connect(self) -> Iterator[Connection]:
        with contextlib.ExitStack() as asking:
            if self._silent:
                if not self._asking.acquire(timeout=_TURN_S):
                    raise StoreError(f"the store {self.shown} does not answer", hint=_CHECK)
                asking.callback(self._asking.release)
            try:
                with self._engine.connect() as connection:
                    self._silent = False
                    asking.close()
                    yield connection
            except exc.OperationalError:
                self._silent = True
                raise

    def check_writable(self) -> None:
        """Check that parts can be written, after a failed write by a write. Raises UnwritableError: it is read-only, or
        another program has locked the parts. StoreError: another reason."""
        failed = self.write_failed
        with self._write_transaction() as tx:  # of SQLite this tells whether the file can be written
            if tx.postgresql:
                _check_postgresql(tx)
            if failed:
                tx.execute(sa.text(f"UPDATE {VERSION_TABLE} SET version_num = version_num"))
        if failed:
            self.write_failed = False

    def close(self) -> None:
        self._engine.dispose()


def _check_postgresql(tx: Transaction) -> None:
    if tx.execute(sa.text("SHOW transaction_read_only")).scalar_one() == "on":
        raise UnwritableError(
            "the store is read-only", hint="point it to the server that takes writes, as after a fail-over"
        )
    tx.execute(sa.text(f"SET LOCAL lock_timeout = '{_LOCKED_S:g}s'"))
    try:
        tx.execute(sa.text("LOCK TABLE parts IN ROW EXCLUSIVE MODE"))
    except exc.OperationalError as error:
        raise UnwritableError(
            "the store's parts are locked by another program", hint="end it, or wait for it"
        ) from error


@contextlib.contextmanager
def _file_locked(file: Path) -> Iterator[None]:
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    # also for the change to WAL, for which SQLite does not wait
    with exclusively(file.with_name(file.name + ".lock")):
        private_file(file)  # what SQLite makes beside it has its mode
        for beside in ("-wal", "-shm"):
            close_to_others(file.with_name(file.name + beside))
        yield


def _checked_url(url: str) -> URL:
    try:
        parsed = sa.make_url(fit(url, "the store's address", limit=_MOST_URL))
    except exc.ArgumentError as error:
        raise StoreError("the store's address is not a URL", hint=_URL_HINT) from error
    backend = parsed.get_backend_name()
    if backend in ("postgresql", "postgres"):
        return parsed.set(drivername="postgresql+psycopg")
    if backend != "sqlite":
        raise StoreError(f"the store cannot be {backend}", hint=_URL_HINT)
    if not parsed.database or ":memory:" in parsed.database or parsed.database.startswith("file:"):
        raise StoreError("a store in memory would lose everything", hint="name a file: sqlite:///file.db")
    return parsed.set(drivername="sqlite+pysqlite")


def _engine(url: URL) -> Engine:
    of_sqlite = url.get_backend_name() == "sqlite"
    options: dict[str, float] = {"timeout": _WAIT_S, "check_same_thread": False}
    try:
        if not of_sqlite:
            from pipeline.store.postgres import PATIENCE, connect

            options = {name: value for name, value in PATIENCE.items() if name not in url.query}
        engine = sa.create_engine(
            url,
            json_serializer=json_text,
            connect_args=options,
            pool_size=_POOL,
            max_overflow=2 * _POOL,
            pool_timeout=_WAIT_S,
            pool_pre_ping=not of_sqlite,
        )
    except ImportError as error:
        raise StoreError(
            f"PostgreSQL needs {error.name}",
            hint="install it with: pip install 'tactile-marks[postgres]', or use sqlite:///file.db",
        ) from error
    if of_sqlite:
        sa.event.listen(engine, "connect", _prepare_sqlite)
        sa.event.listen(engine, "begin", _begin_in_sqlite)
    else:
        sa.event.listen(engine, "do_connect", lambda _dialect, _entry, args, more: connect(*args, **more))
    return engine


def _prepare_sqlite(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    # transactions begin at our BEGIN, not where the driver would begin them
    connection.isolation_level = None
    cursor = connection.cursor()
    for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def _begin_in_sqlite(connection: Connection) -> None:
    writes = connection.get_execution_options().get("tactile_marks_writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _bring_up_to_date(engine: Engine, shown: str, *, as_it_is: bool) -> None:
    from alembic.operations import Operations
    from alembic.runtime.migration import MigrationContext
    from alembic.script import ScriptDirectory
    from alembic.util import CommandError

    script = ScriptDirectory(str(MIGRATIONS))
    with (
        _migrating,
        engine.connect().execution_options(tactile_marks_writes=True) as connection,
        connection.begin(),
    ):
        if engine.dialect.name == "postgresql":
            raw: Any = connection.connection.dbapi_connection
            raw.silent_s = None  # another process may take long to bring the tables up to date
            connection.detach()
            connection.exec_driver_sql("SET LOCAL lock_timeout = 0")
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(_ADVISORY_LOCK)))
        options = {"version_table": VERSION_TABLE, "render_as_batch": True}
        context = MigrationContext.configure(connection, opts=options)
        current = context.get_current_revision()
        if current == script.get_current_head():
            return
        try:
            script.get_revision(current or "base")
        except CommandError as error:
            raise StoreError(
                f"the store {shown} is of a version ({current}) that this tactile-marks does not know",
                hint="install the one that made it, or name another store",
            ) from error
        if as_it_is:
            what = f"is of an older version ({current})" if current else "has no tables"
            raise StoreError(
                f"the store {shown} {what}",
                hint="start the service of this version once, or use the tactile-marks that made it",
            )
        if current is None:
            METADATA.create_all(connection, checkfirst=False)
        else:
            with Operations.context(context):
                for revision in reversed([*script.iterate_revisions("head", current)]):
                    revision.module.upgrade()
        context.stamp(script, "head")


@contextlib.contextmanager
def _store_errors(shown: str) -> Iterator[None]:
    try:
        yield
    except (exc.SQLAlchemyError, OSError) as error:
        orig = getattr(error, "orig", None) or error
        if isinstance(orig, UnfitError):
            raise orig from error
        reason = " ".join(str(orig).split())[:300]
        if any(words in reason for words in ("disk I/O error", "disk is full", "No space left")):
            hint = "make room on its disk, or check the disk"
        elif any(words in reason for words in ("malformed", "not a database")):
            hint = "check its address, or stop the service and restore the last good backup"
        else:
            hint = _CHECK
        raise StoreError(f"the store {shown} does not answer ({reason})", hint=hint) from error
