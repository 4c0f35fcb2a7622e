"""Files for their owner alone."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.common.private import private_file

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="modes and locks of POSIX")

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
