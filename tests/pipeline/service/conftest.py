"""Tests that are coroutines run on asyncio, by the plugin that anyio brings."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    return "asyncio"
