"""A PostgreSQL server of the tests' own: on a socket in its own folder and on no port, ended with its parent."""

from __future__ import annotations

import contextlib
import ctypes
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.support.waiting import program

_START_S = 30.0
_PR_SET_PDEATHSIG = 1


class PostgresServer:
    """One server with its data; may be killed and started again."""

    def __init__(self) -> None:
        """Make its data and start it."""
        self._program, initdb, self._user = program("postgres"), program("initdb"), _unprivileged()
        self.folder = Path(tempfile.mkdtemp(prefix="tactile-marks-pg-"))
        self._process: subprocess.Popen[bytes] | None = None
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

    def kill(self) -> None:
        """As a crash does."""
        self._end(signal.SIGKILL)

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """Stop all its processes, which keep their sockets open; they go on at the end."""
        assert self._process is not None
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
