"""A pipe where a file is asked for is refused, not waited for; a disk or store that fails is one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.contract.front_doors import Command, environment
from tests.support.waiting import PATIENCE_S

FILES = ("config", "database", "lexicon", "job", "truth", "order", "certificate")


def _waits(*_: object) -> None:
    raise TimeoutError("it waits for the pipe")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes have names here")
@pytest.mark.parametrize(
    "arguments",
    [
        *(
            ("read", "PLATE", f"--{name}", "PIPE")
            for name in ("config", "database", "lexicon", "job", "truth", "order")
        ),
        ("read", "--manifest", "PIPE"),
        ("serve", "--config", "PIPE"),
        ("serve", "--database", "PIPE"),
        ("serve", "--port", "0", "--tls.certificate", "PIPE"),
        ("serve", "--port", "0", "--opcua.certificate", "PIPE"),
        ("serve", "--port", "0", "--stage.device", "PIPE"),
        ("glyphs", "list", "--database", "PIPE"),
    ],
    ids=" ".join,
)
def test_a_pipe_is_no_file(
    command: Command,
    height_map: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    given = {"PLATE": str(height_map), "PIPE": "pipe"}
    signal.signal(signal.SIGALRM, _waits)
    signal.alarm(round(PATIENCE_S))
    try:
        ended = command(*(given.get(argument, argument) for argument in arguments))
    finally:
        signal.alarm(0)
    assert ended.status in (1, 2)
    assert "pipe" in ended.err
    assert len(ended.err.splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="a file can be limited here alone")
def test_a_backup_that_does_not_fit_is_one_line(command: Command, tmp_path: Path) -> None:
    store = f"sqlite:///{tmp_path}/store.db"
    assert command("tokens", "add", "line", "--scope", "read", "--store", store).status == 0
    # no file may grow beyond 60 kB, as on a disk that is full
    limited = "import resource as r, sys; r.setrlimit(r.RLIMIT_FSIZE, (60_000, 60_000)); "
    ended = subprocess.run(
        [sys.executable, "-c", limited + "from pipeline.cli.main import main; sys.exit(main(sys.argv[1:]))",
         "store", "backup", str(tmp_path / "b"), "--store", store],
        cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False, timeout=60.0,
    )  # fmt: skip
    assert ended.returncode == 1, ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert "room" in ended.stderr
    assert not (tmp_path / "b").exists()
    assert command("store", "backup", tmp_path / "b", "--store", store, "--folder", tmp_path).status == 0
