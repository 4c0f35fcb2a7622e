"""A service in a process of its own, started and ended from here: for the demonstration, load and tests."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import time
from collections.abc import Iterator
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
    """Start `tactile-marks serve` on a free port of this machine; on leaving, ask it to end, then kill it.

    Args:
        folder: folder of the service, with its log in `service.log`.
        options: options of `serve`.
        environment: environment of the process (default: this process's).
        ready: wait until parts can be read.

    Raises:
        NotServingError: the service does not start.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "service.log"
    command = [sys.executable, "-m", "pipeline", "serve", "--port", "0", "--folder", str(folder), *options]
    with log.open("ab") as stream:
        begin = stream.tell()
        process = subprocess.Popen(command, stderr=stream, stdout=stream, env=environment)
    until = time.monotonic() + START_PATIENCE_S
    try:
        url = ""
        while not url or (ready and not _is_ready(url)):
            if process.poll() is not None or time.monotonic() > until:
                words = " | ".join(log.read_text(encoding="utf-8", errors="replace").splitlines()[-5:])
                raise NotServingError(f"the service does not come up: {words or 'it logged nothing'}")
            time.sleep(0.05)
            found = _SERVES.search(log.read_bytes()[begin:].decode("utf-8", "replace"))
            url = found[1] if found else ""
        yield ServiceProcess(url, process, log)
    finally:
        _end(process)


def _is_ready(url: str) -> bool:
    import httpx

    with contextlib.suppress(httpx.TransportError):
        return httpx.get(f"{url}/readyz", timeout=5.0, verify=False).status_code == 200
    return False


def _end(process: subprocess.Popen[bytes], *, patience_s: float = 30.0) -> None:
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
