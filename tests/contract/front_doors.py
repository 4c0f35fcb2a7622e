"""The ways in that users have: command, files and a service in a process of its own."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import numpy as np

from glyphs import stamp
from tests.support.run_tables import csv_rows
from tests.support.waiting import PATIENCE_S, wait_until

ROOT = Path(__file__).parents[2]
READY_LOOK_S = 0.2
"""Between two looks at a service that starts, which takes seconds; every answer costs it some milliseconds."""


@dataclass(frozen=True)
class Ended:
    """A command that has ended: its exit status and what it printed."""

    status: int
    out: str
    err: str


class Command(Protocol):
    """Runs `tactile-marks` with arguments."""

    def __call__(self, *arguments: str | os.PathLike[str]) -> Ended: ...


@dataclass(frozen=True)
class RunningService:
    """A service in a process of its own.

    Attributes:
        url: its address, http://127.0.0.1:PORT.
        process: the web server; its workers are its children.
        folder: its folder, with `store.db` and `service.log`.
    """

    url: str
    process: subprocess.Popen[bytes]
    folder: Path

    @property
    def log(self) -> str:
        """What it has logged so far."""
        return (self.folder / "service.log").read_text(encoding="utf-8", errors="replace")


def main(arguments: Sequence[str]) -> int:
    """Run `tactile-marks` in this process; its exit status."""
    (entry,) = entry_points(group="console_scripts", name="tactile-marks")
    try:
        status = entry.load()(list(arguments))
    except SystemExit as ended:  # as a shell would see it
        status = ended.code if isinstance(ended.code, int) else 1
    return status or 0


def synth(folder: Path, format: str, *options: str, parts: int = 1) -> Path:
    """Stamp parts `part-000.npz` and so on with `tactile-marks synth`; the folder."""
    assert main(["synth", str(folder), "--parts", str(parts), "--format", format, *options]) == 0
    return folder


def truth_of(folder: Path) -> dict[str, str]:
    """The stamped text of each part in a folder that `synth` made."""
    return {row["part"]: row["text"] for row in csv_rows(folder / "truth.csv")}


def environment(**changes: str) -> dict[str, str]:
    """The environment of a child: this checkout, no settings of this machine."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("TACTILE_MARKS_")}
    return {**kept, "PYTHONPATH": str(ROOT), **changes}


def run_process(
    *arguments: str | os.PathLike[str], cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> Ended:
    """Run `tactile-marks` in a process of its own and wait for its end."""
    done = subprocess.run(
        [sys.executable, "-m", "pipeline", *map(os.fspath, arguments)],
        cwd=cwd, env=dict(env or environment()), capture_output=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    return Ended(done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace"))


def start_process(*arguments: str | os.PathLike[str], cwd: Path | None = None) -> subprocess.Popen[str]:
    """Start `tactile-marks` in a process of its own; `communicate` waits for it."""
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline", *map(os.fspath, arguments)],
        cwd=cwd, env=environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


@contextlib.contextmanager
def run_service(
    folder: Path, *options: str, env: Mapping[str, str] | None = None, ready: bool = True
) -> Iterator[RunningService]:
    """Serve on a free port until the block is left.

    Args:
        folder: folder of the service.
        options: options of `tactile-marks serve`.
        env: environment of the process.
        ready: wait until `/readyz` answers 200.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "service.log"
    with log.open("ab") as stream:
        begin = stream.tell()
        process = subprocess.Popen(
            [sys.executable, "-m", "pipeline", "serve", "--port", "0", "--folder", str(folder), *options],
            stdout=stream, stderr=stream, env=dict(env or environment()),
        )  # fmt: skip
    try:
        running = RunningService(address_in(log, process, begin), process, folder)
        if ready:
            wait_until(lambda: status_of(f"{running.url}/readyz") == 200, process, look_s=READY_LOOK_S)
        yield running
    finally:
        process.terminate()
        try:
            process.wait(30.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def status_of(url: str) -> int:
    """The status of a GET; 0 where nothing answers."""
    asked = urlsplit(url)
    with contextlib.closing(HTTPConnection(asked.netloc, timeout=10.0)) as connection:
        try:
            connection.request("GET", asked._replace(scheme="", netloc="").geturl() or "/")
            return connection.getresponse().status
        except (OSError, HTTPException):
            return 0


def save_height_map(path: Path, text: str, *, height_mm: float = 4.0) -> Path:
    """Stamp a clean plate and save its heights as npz."""
    surface = stamp(text, fonts="gothic", height_mm=height_mm, seed=3).height_map
    np.savez(path, z_mm=surface.z_mm, pitch_mm=surface.pitch_mm)
    return path


def address_in(log: Path, process: subprocess.Popen[bytes], begin: int = 0) -> str:
    """Wait for the address that a starting service logs, from a byte of its log on."""
    found: list[str] = []

    def is_named() -> bool:
        found.extend(
            re.findall(r"serves at (https?://\S+)", log.read_bytes()[begin:].decode(errors="replace"))
        )
        return bool(found)

    wait_until(is_named, process)
    return found[0]
