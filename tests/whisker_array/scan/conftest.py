"""A recording that a test may change."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def recording(content: bytes, tmp_path: Path) -> Path:
    """A file of what the module's `content` is."""
    path = tmp_path / "scan.h5"
    path.write_bytes(content)
    return path
