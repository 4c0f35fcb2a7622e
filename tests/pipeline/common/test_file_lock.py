"""Locks on files, and the program on systems that lack what Linux has."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from glyphs.file_lock import exclusively

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
