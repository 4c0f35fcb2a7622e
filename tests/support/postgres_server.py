"""A PostgreSQL server of the tests' own: on a socket in its own folder and on no port, ended with its parent."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.support.waiting import program

if TYPE_CHECKING:
    import psycopg

_START_S = 30.0
_PR_SET_PDEATHSIG = 1


# what the tables of a database are like, whatever is in them
_SHAPE = """SELECT string_agg(line, ' ' ORDER BY line) FROM (
    SELECT concat_ws(' ', table_name, column_name, data_type, is_nullable, column_default) AS line
        FROM information_schema.columns WHERE table_schema = 'public'
    UNION ALL SELECT indexdef FROM pg_indexes WHERE schemaname = 'public'
    UNION ALL SELECT conrelid::regclass || pg_get_constraintdef(oid) FROM pg_constraint
        WHERE connamespace = 'public'::regnamespace
    UNION ALL SELECT setconfig::text FROM pg_db_role_setting) AS lines"""
Content = tuple[Any, dict[str, bytes], list[tuple[str, int | None]]]


def _content(connection: psycopg.Connection) -> Content:
    """Shape, rows of each table as they are copied, and last values of the sequences of a database."""
    names = connection.execute("SELECT tablename FROM pg_tables WHERE schemaname = 'public'").fetchall()
    tables = {}
    for (name,) in names:
        with connection.cursor().copy(f'COPY "{name}" TO STDOUT'.encode()) as copy:
            tables[name] = b"".join(map(bytes, copy))
    sequences = connection.execute("SELECT sequencename, last_value FROM pg_sequences").fetchall()
    return connection.execute(_SHAPE).fetchone(), tables, sequences


class PostgresServer:
    """One server with its data; may be killed and started again."""

    def __init__(self) -> None:
        """Make its data and start it."""
        self._program, initdb, self._user = program("postgres"), program("initdb"), _unprivileged()
        self.folder = Path(tempfile.mkdtemp(prefix="tactile-marks-pg-"))
        self._process: subprocess.Popen[bytes] | None = None
        self._clean, self._numbers = list[str](), itertools.count()
        self._templates: dict[str, Content] = {}
        try:
            if self._user is not None:
                os.chown(self.folder, self._user, -1)
            owner = ["-U", "postgres", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8", "--no-sync"]
            subprocess.run(
                [initdb, "-D", self.folder / "data", *owner],
                check=True,
                capture_output=True,
                cwd=self.folder,
                user=self._user,
            )
            self.start()
        except BaseException:
            self.close()
            raise

    def start(self) -> None:
        """Start it, and wait until it answers."""
        import psycopg

        options = {
            "listen_addresses": "",
            "unix_socket_directories": str(self.folder),
            "fsync": "off",
            "max_connections": "200",
        }
        log = self.folder / "log"
        end_s = time.monotonic() + _START_S
        while True:
            if self._process is None or self._process.poll() is not None:
                # also where those of a server that was killed still hold its memory
                assert time.monotonic() < end_s, f"no PostgreSQL: {log.read_text(errors='replace')[-2000:]}"
                with log.open("ab") as stream:
                    self._process = subprocess.Popen(
                        [
                            self._program,
                            "-D",
                            self.folder / "data",
                            *(f"--{k}={v}" for k, v in options.items()),
                        ],
                        stdout=stream,
                        stderr=stream,
                        cwd=self.folder,
                        user=self._user,
                        preexec_fn=_end_with_parent,
                    )
            with contextlib.suppress(psycopg.OperationalError):
                psycopg.connect(self.url("postgres")).close()
                return
            assert time.monotonic() < end_s, (
                f"PostgreSQL is silent: {log.read_text(errors='replace')[-2000:]}"
            )
            time.sleep(0.02)

    def url(self, name: str) -> str:
        """Of a database of its, by name."""
        return f"postgresql://postgres@/{name}?host={self.folder}"

    def create(self, name: str, *, like: str = "template1") -> str:
        """Make a database, empty or with all that another has; its URL."""
        import psycopg

        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name} TEMPLATE {like} STRATEGY FILE_COPY".encode())
        return self.url(name)

    def lend(self, like: str) -> str:
        """Name of a database with all that another has: one that was given back, or a new one, of 400 files."""
        if not self._clean:
            self._clean.append(f"lent_{next(self._numbers)}")
            self.create(self._clean[-1], like=like)
        return self._clean.pop()

    def take_back(self, name: str, like: str) -> None:
        """Give a database again what the other has; one whose tables were changed, or that is in use, is left."""
        import psycopg

        if like not in self._templates:
            with psycopg.connect(self.url(like)) as connection:
                self._templates[like] = _content(connection)
        shape, tables, sequences = self._templates[like]
        with contextlib.suppress(psycopg.Error), psycopg.connect(self.url(name)) as connection:
            connection.execute("SET lock_timeout = '1s'")
            connection.execute("SET session_replication_role = replica")  # rows go in any order
            if connection.execute(_SHAPE).fetchone() != shape:
                return
            for table, rows in tables.items():
                connection.execute(f'DELETE FROM "{table}"'.encode())
                if rows:
                    with connection.cursor().copy(f'COPY "{table}" FROM STDIN'.encode()) as copy:
                        copy.write(rows)
            for sequence, value in sequences:
                connection.execute("SELECT setval(%s, %s, %s)", (sequence, value or 1, value is not None))
            connection.commit()
            self._clean.append(name)

    def kill(self) -> None:
        """As a crash does."""
        self._end(signal.SIGKILL)

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """Stop all its processes, which keep their sockets open; they go on at the end."""
        main = self._process.pid
        self._process.send_signal(signal.SIGSTOP)
        children = Path(f"/proc/{main}/task/{main}/children").read_text(encoding="ascii").split()
        family = [main, *map(int, children)]
        try:
            _signal(family, signal.SIGSTOP)
            yield
        finally:
            _signal(family, signal.SIGCONT)

    def close(self) -> None:
        """End it and remove its data."""
        self._end(signal.SIGQUIT)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait(_START_S)
            self._process = None


def _signal(family: Sequence[int], what: signal.Signals) -> None:
    for process in family:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, what)


def _unprivileged() -> int | None:
    """Whom to run the server as, which refuses root; None: as we are."""
    if os.geteuid() != 0:
        return None
    for name in ("postgres", "nobody"):
        with contextlib.suppress(KeyError):
            return pwd.getpwnam(name).pw_uid
    raise AssertionError("PostgreSQL does not run as root, and there is neither a user postgres nor nobody")


def _end_with_parent() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGQUIT)
