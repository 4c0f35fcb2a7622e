"""A service in its own process, for demonstration, load tests and screenshots."""

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

_SERVES = re.compile(r"serves at (http://\S+)")
# the first start on a machine compiles the kernels
START_PATIENCE_S = 120.0
_END_PATIENCE_S = 30.0


class NotServingError(MarksError):
    """A service did not start; the message ends with its last log lines."""

    is_usage = False


@dataclass(frozen=True)
class ServiceProcess:
    """A running service: the web server; its workers are its children."""

    url: str
    process: subprocess.Popen[bytes]


@contextlib.contextmanager
def service_process(folder: Path, *options: str) -> Iterator[ServiceProcess]:
    """Run `tactile-marks serve` on a free port; its log is `service.log` in the folder. Raises NotServingError."""
    folder.mkdir(parents=True, exist_ok=True)
    log, until = folder / "service.log", time.monotonic() + START_PATIENCE_S
    command = [sys.executable, "-m", "pipeline", "serve", "--port", "0", "--folder", str(folder), *options]
    with log.open("wb") as stream:
        process = subprocess.Popen(command, stderr=stream, stdout=stream)
    try:
        while not (url := _ready_at(logged := log.read_text(encoding="utf-8", errors="replace"))):
            if process.poll() is not None or time.monotonic() > until:
                words = " | ".join(logged.splitlines()[-5:])
                raise NotServingError(f"the service does not start: {words or 'it logged nothing'}")
            time.sleep(0.05)
        yield ServiceProcess(url, process)
    finally:
        process.terminate()
        try:
            process.wait(_END_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _ready_at(logged: str) -> str:
    import httpx

    address = _SERVES.search(logged)
    with contextlib.suppress(httpx.TransportError):
        return address[1] if address and httpx.get(f"{address[1]}/readyz", timeout=5.0).is_success else ""
    return ""
