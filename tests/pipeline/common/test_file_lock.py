"""Locks, files for their owner alone, loops that are interrupted, and systems that lack what Linux has."""

from __future__ import annotations

import contextlib
import importlib
import os
import pkgutil
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from glyphs.errors import FileError
from glyphs.file_lock import exclusively
from pipeline.common.private import private_file
from pipeline.errors import DataError, processor_limit, reading

pytest.importorskip("fcntl")
OWN = ("glyphs", "whisker_array", "recognition", "pipeline")

LOCKING = """
import builtins, fcntl, importlib, os, sys, types

def locking(handle, how, n_bytes):
    # bytes from where the file stands, as on Windows
    try:
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, n_bytes, 0, os.SEEK_CUR)
    except OSError as error:
        raise PermissionError(13, "Permission denied") from error

msvcrt = types.SimpleNamespace(locking=locking, LK_NBLCK=2)
"""
ELSEWHERE = f"""{LOCKING}
real = builtins.__import__

def poorer(name, *more, **named):
    if more and more[0] and more[0].get("__name__", "").partition(".")[0] in {OWN}:
        if name in ("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty"):
            raise ModuleNotFoundError("not on this system", name=name)
        if name == "msvcrt":
            return msvcrt
    return real(name, *more, **named)

builtins.__import__ = poorer
for name in ("fork", "register_at_fork", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "sysconf",
             "sched_getaffinity"):
    delattr(os, name)
"""
"""Makes a process in which our own modules find what Windows has, and no more."""


def elsewhere(program: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What a program does there."""
    return subprocess.run(
        [sys.executable, "-c", ELSEWHERE + program, *arguments], cwd=folder, capture_output=True, text=True
    )


def test_every_module_can_be_imported_and_a_table_written_elsewhere(tmp_path: Path) -> None:
    roots = [importlib.import_module(name) for name in OWN]
    names = [
        module.name
        for root in roots
        for module in pkgutil.walk_packages(root.__path__, f"{root.__name__}.")
        # what Alembic runs, and what ends the process
        if ".migrations" not in module.name and not module.name.endswith("__main__")
    ]
    assert len(names) > 200
    (tmp_path / "part.npz").write_bytes(b"rubbish")
    done = elsewhere(
        "from pipeline.cli.main import main\n"
        "for table in ('rows.csv', 'rows.parquet'):\n"
        "    assert main(['read', 'part.npz', '--out', table]) == 1\n"
        "print('modules:')\n"
        "for name in sys.argv[1:]:\n"
        "    try:\n        importlib.import_module(name)\n"
        "    except Exception as error:\n"
        "        if getattr(error, 'name', '') not in ('torch', 'onnx'):\n"  # of the extra train
        "            print(name, repr(error))\n",
        *names,
        folder=tmp_path,
    )
    assert (done.stdout.partition("modules:\n")[2], done.returncode) == ("", 0), done.stderr
    assert "Traceback" not in done.stderr
    assert "part.npz: " in (tmp_path / "rows.csv").read_text()
    assert sorted(p.name for p in tmp_path.glob("rows*")) == [
        "rows.csv", "rows.parquet", "rows.quarantine.csv", "rows.quarantine.csv~",
    ]  # fmt: skip


HOLDER = """
from pathlib import Path
from glyphs.file_lock import exclusively
with exclusively(Path(sys.argv[1])):
    print(flush=True)
    input()
"""


@pytest.mark.parametrize("before", ["import os, sys\n", ELSEWHERE], ids=["flock", "msvcrt"])
def test_a_lock_ends_with_its_holder(before: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "lock"
    if before == ELSEWHERE:
        space: dict[str, Any] = {}
        exec(LOCKING, space)
        monkeypatch.setitem(sys.modules, "msvcrt", space["msvcrt"])
        monkeypatch.setitem(sys.modules, "fcntl", None)
    holder = subprocess.Popen(
        [sys.executable, "-c", before + HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout is not None
    holder.stdout.readline()
    try:
        with exclusively(path, wait=False) as held:
            assert not held
        holder.kill()
        with exclusively(path) as held:
            assert held
    finally:
        holder.communicate()


TRIES_TO_LOCK = """
import fcntl, sys
try:
    fcntl.lockf(open(sys.argv[1], "r+b"), fcntl.LOCK_EX | fcntl.LOCK_NB)
except OSError:
    print("held")
"""


def test_a_file_is_made_for_its_owner_and_one_that_is_there_keeps_what_it_holds(tmp_path: Path) -> None:
    file = tmp_path / "store.db"
    private_file(file)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    file.write_bytes(b"kept")
    file.chmod(0o644)
    private_file(file)
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"kept", 0o600)


def test_a_lock_that_this_process_has_on_the_file_stays(tmp_path: Path) -> None:
    """A second store opened on it had let go of the first one's lock, and another process took away its log."""
    import fcntl

    file = tmp_path / "store.db"
    private_file(file)
    with file.open("r+b") as opened:
        fcntl.lockf(opened, fcntl.LOCK_EX)
        private_file(file)
        other = subprocess.run(
            [sys.executable, "-c", TRIES_TO_LOCK, os.fspath(file)], capture_output=True, text=True, check=True
        )
    assert other.stdout == "held\n"


ENOUGH = 2**62


def count_up(most: int = ENOUGH) -> None:
    for _ in range(most):
        pass


def test_a_loop_is_interrupted_and_later_ones_are_not() -> None:
    with (
        pytest.raises(DataError, match=r"takes more than 0 s to decode.*; export it again"),
        processor_limit(0.1),
    ):
        count_up()
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGPROF) is signal.SIG_DFL


def test_code_that_ignores_any_exception_is_interrupted_again() -> None:
    def stubborn() -> None:
        with contextlib.suppress(Exception):
            count_up()
        count_up()

    with pytest.raises(DataError), processor_limit(0.1):
        stubborn()


def test_within_another_limit_and_in_other_threads_nothing_is_set() -> None:
    with processor_limit(100.0), processor_limit(0.001):
        count_up(2_000_000)
    thread = threading.Thread(target=lambda: processor_limit(0.001).__enter__())
    thread.start()
    thread.join()
    assert signal.getsignal(signal.SIGPROF) is signal.SIG_DFL


def test_the_file_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.errors._SPARE_S", 0.1)
    (tmp_path / "a.ezd").write_bytes(b"x")
    with (
        pytest.raises(FileError, match=r"a\.ezd: takes more than 0 s"),
        reading(tmp_path / "a.ezd", kind="x", most_bytes=9),
    ):
        count_up()
