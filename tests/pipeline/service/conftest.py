"""Tests that are coroutines run on asyncio, by the plugin that anyio brings; an outbox to send from."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.line_fakes import Outbox


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture
def outbox(tmp_path: Path) -> Iterator[Outbox]:
    with contextlib.closing(Outbox.open(f"sqlite:///{tmp_path}/outbox.db")) as made:
        yield made
