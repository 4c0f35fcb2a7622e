"""The service's log."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CODE = """
import logging, os, resource, signal
from pipeline.cli.main import _open_streams
from pipeline.service.logs import set_up_logs

def limit(n_bytes):
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, resource.RLIM_INFINITY))

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
_open_streams()
set_up_logs()
log = logging.getLogger("tactile-marks")
log.warning("before")
limit(os.fstat(2).st_size)
for _ in range(1000):
    log.warning("no room")
limit(resource.RLIM_INFINITY)
log.warning("room again")
log.warning("after")
"""


def test_the_log_goes_on_once_there_is_room_again(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as stream:
        ended = subprocess.run([sys.executable, "-c", CODE], stderr=stream, check=False)
    lines = (tmp_path / "log").read_text().splitlines()
    assert ended.returncode == 0
    assert "before" in lines[0]
    assert "after" in lines[-1]
