"""Coroutines run on asyncio, by the plugin that anyio brings; a clean part, and an outbox to send from."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.formats.synth import SynthSpec, write_part
from tests.support.line_fakes import Outbox


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture
def outbox(tmp_path: Path) -> Iterator[Outbox]:
    with contextlib.closing(Outbox.open(f"sqlite:///{tmp_path}/outbox.db")) as made:
        yield made


@pytest.fixture(scope="session")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Height map and photograph of the part `clean`, which touch and camera read; clean.txt is what it bears."""
    folder = tmp_path_factory.mktemp("parts")
    text = write_part(SynthSpec(format="AA99", seed=21), folder / "clean", 0, photos=True)
    (folder / "clean.txt").write_text(text)
    return folder
