"""A service in a process of its own, started and ended from here: for the demonstration, load and tests."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from glyphs.errors import MarksError

_SERVES = re.compile(r"serves at (https?://\S+)")
START_PATIENCE_S = 120.0
"""The first start on a machine compiles the kernels."""


class NotServingError(MarksError):
    """A service that did not come up; the message ends with what it logged last."""


@dataclass(frozen=True)
class ServiceProcess:
    """A running service.

    Attributes:
        url: where it answers.
        process: the web server; its workers are its children.
        log: file of its log lines.
    """

    url: str
    process: subprocess.Popen[bytes]
    log: Path


@contextlib.contextmanager
def service_process(
    folder: Path, *options: str, environment: dict[str, str] | None = None, ready: bool = True
) -> Iterator[ServiceProcess]:
    """Start `tactile-marks serve` on a free port of this machine; on leaving it is asked to end, then made to.

    Args:
        folder: of the service, with its log in `service.log`.
        options: of `serve`.
        environment: of the process; this one's unless given.
        ready: wait until parts can be read.

    Raises:
        NotServingError: it does not come up.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "service.log"
    arguments = [
        sys.executable,
        "-m",
        "pipeline",
        "serve",
        "--port",
        "0",
        "--folder",
        str(folder),
        *options,
    ]
    with log.open("ab") as stream:
        begin = stream.tell()
        process = subprocess.Popen(arguments, stderr=stream, stdout=stream, env=environment)
    try:
        url = _address(process, log, begin)
        if ready:
            _wait_until_ready(process, url, log)
        yield ServiceProcess(url, process, log)
    finally:
        _end(process)


def _address(process: subprocess.Popen[bytes], log: Path, begin: int) -> str:
    until = time.monotonic() + START_PATIENCE_S
    while time.monotonic() < until:
        with log.open("rb") as stream:
            stream.seek(begin)
            found = _SERVES.search(stream.read().decode("utf-8", "replace"))
        if found:
            return found[1]
        if process.poll() is not None:
            break
        time.sleep(0.05)
    raise NotServingError(f"the service did not start: {_last_lines(log)}")


def _wait_until_ready(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    import httpx

    until = time.monotonic() + START_PATIENCE_S
    while time.monotonic() < until and process.poll() is None:
        with contextlib.suppress(httpx.TransportError):
            if httpx.get(f"{url}/readyz", timeout=5.0, verify=False).status_code == 200:
                return
        time.sleep(0.1)
    raise NotServingError(f"the service is not ready: {_last_lines(log)}")


def _end(process: subprocess.Popen[bytes], *, patience_s: float = 30.0) -> None:
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _last_lines(log: Path, n: int = 5) -> str:
    lines: Sequence[str] = log.read_text(encoding="utf-8", errors="replace").splitlines()
    return " | ".join(lines[-n:]) or "it logged nothing"
