"""What is logged in bursts or on a full disk, and whose connection is closed if there is no room."""

from __future__ import annotations

import asyncio
import errno
import logging
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pipeline.service.connections import address_block, log_failed_accepts_sparingly

pytestmark = pytest.mark.anyio


@pytest.mark.parametrize(
    ("address", "block"),
    [
        ("192.168.7.9", "192.168.7.9"),
        ("::ffff:192.168.7.9", "192.168.7.9"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", "2001:db8:1:2::/64"),
        ("2001:db8:1:3::1", "2001:db8:1:3::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("unix", "unix"),
    ],
)
def test_a_network_of_ipv6_is_one_caller(address: str, block: str) -> None:
    assert address_block(address) == block


async def test_accepts_without_descriptors_are_one_line_and_other_faults_as_ever(
    caplog: pytest.LogCaptureFixture,
) -> None:
    loop = asyncio.get_running_loop()
    log_failed_accepts_sparingly()
    context: dict[str, Any] = {"message": "socket.accept() out of system resource", "socket": object()}
    with caplog.at_level(logging.WARNING):
        for _ in range(2048):
            loop.call_exception_handler(
                {**context, "exception": OSError(errno.EMFILE, "Too many open files")}
            )
        assert (caplog.text.count("ulimit -n"), len(caplog.records)) == (1, 1)
        loop.call_exception_handler({"message": "a fault", "exception": ValueError("wrong")})
    assert "a fault" in caplog.text


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
def test_the_soft_limit_of_descriptors_is_raised() -> None:
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (64, 512));"
        "from pipeline.service.connections import raise_descriptor_limit;"
        "print(raise_descriptor_limit(), *resource.getrlimit(resource.RLIMIT_NOFILE))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["512", "512", "512"]


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
