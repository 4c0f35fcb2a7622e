"""Waiting for processes and threads, how they are found, and programs that pip does not bring."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import pytest

# ----------------------------------------------------------------------------------------------------------- waiting

PATIENCE_S = 120.0
"""Within which anything happens that happens at all; the first start on a machine compiles the kernels."""
LOOK_S = 0.02
"""Between two looks: what is waited for needs the processor."""


class Ending(Protocol):
    """A process that may end while something is waited for."""

    returncode: int | None

    def poll(self) -> int | None: ...


def wait_until(
    holds: Callable[[], object], process: Ending | None = None, *, why: str = "", look_s: float = LOOK_S
) -> None:
    """Wait for a condition that must come true; fail when the process ends or patience does."""
    end_s = time.monotonic() + PATIENCE_S
    while not holds():
        assert process is None or process.poll() is None, f"the process ended with {process.returncode}"
        assert time.monotonic() < end_s, f"waited in vain {why}"
        time.sleep(look_s)


def free_port() -> int:
    """A port of the loopback address that was free a moment ago."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def listens(port: int) -> bool:
    """Whether somebody takes connections at a port of the loopback address."""
    with socket.socket() as one:
        one.settimeout(0.5)
        return one.connect_ex(("127.0.0.1", port)) == 0


def children(pid: int) -> list[int]:
    """All processes below a process, from Linux's own list."""
    found: list[int] = []
    todo = [pid]
    while todo:
        for listed in Path(f"/proc/{todo.pop()}/task").glob("*/children"):
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                below = [int(child) for child in listed.read_text().split()]
                found += below
                todo += below
    return found


def is_alive(pid: int) -> bool:
    """Whether a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


# ---------------------------------------------------------------------------------------------------------- programs

_PLACES = (
    str(Path(sys.executable).parent),
    *("/usr/sbin", "/usr/local/sbin"),
    *map(str, Path("/usr/lib/postgresql").glob("*/bin")),
)


def program(name: str) -> str:
    """Where a program is; skips the test, or fails it where everything must be tested."""
    found = shutil.which(name) or shutil.which(name, path=os.pathsep.join(_PLACES))
    if found is None:
        told = f"{name} is not installed"
        if os.environ.get("MARKS_TEST_ALL") == "1":
            pytest.fail(f"{told}, and MARKS_TEST_ALL asks for every test")
        pytest.skip(told)
    return found
