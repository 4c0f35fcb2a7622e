"""Programs that tests need and that pip does not bring, or brings beside Python."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

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
