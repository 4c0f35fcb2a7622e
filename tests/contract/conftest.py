"""Fixtures of the contract suite: the command and a part on disk.

The suite holds what users and other programs rely on. It works by files, the command line, HTTP, TCP, MQTT and the
names that the four packages export, so that every room behind them can be rebuilt while these tests stay as they are.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.front_doors import Command, Ended, RunningService, main, run_service, save_height_map


@pytest.fixture(autouse=True)
def _no_settings_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [n for n in os.environ if n.startswith("TACTILE_MARKS_")]:
        monkeypatch.delenv(name)


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Run `tactile-marks` in this process: `command("read", "part.npz").status`."""

    def run(*arguments: str | os.PathLike[str]) -> Ended:
        capsys.readouterr()
        status = main([os.fspath(argument) for argument in arguments])
        shown = capsys.readouterr()
        return Ended(status, shown.out, shown.err)

    return run


@pytest.fixture(scope="session")
def height_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean plate stamped `K7` in gothic, 4 mm high, as an npz file. Do not change it."""
    return save_height_map(tmp_path_factory.mktemp("plate") / "K7.npz", "K7")


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A service that this worker's tests share; it reads `A9` in gothic, 4 mm high, without tokens."""
    reading = ("--format", "A9", "--font", "gothic", "--height-mm", "4")
    with run_service(
        tmp_path_factory.mktemp("service"), "--jobs", "1", "--tokens", "off", *reading
    ) as running:
        yield running
