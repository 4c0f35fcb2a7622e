"""The worked example of the page on imported traces: its commands and script, in the reader's order."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import pytest

from pipeline.cli.main import main

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "how-to" / "import.md"


def test_the_example_of_imported_traces_reads_the_plate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ran, printed = 0, ""
    for kind, block in re.findall(r"^```(\w*)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S):
        if kind == "toml":
            Path("traces.toml").write_text(block, encoding="utf-8")
        elif kind == "python":
            Path("script.py").write_text(block, encoding="utf-8")
            runpy.run_path("script.py")
        elif kind == "text":
            assert block in printed
        else:
            printed = ""
            for command in block.splitlines():
                assert main(shlex.split(command)[1:]) == 0, command
                printed, ran = printed + capsys.readouterr().out, ran + 1
    assert ran == 6
    assert "S9    accept" in printed
