"""How far a run is, as a person at a terminal and a log see it."""

from __future__ import annotations

import io
import sys

import pytest

from pipeline.runs.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_log_has_a_line_a_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with Progress() as progress:
        progress.start(2000, 1000)
        for k in range(200):
            now += 0.5
            progress.advance(failed=k < 3)
        progress.step("for a terminal only")
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.splitlines() == [
        "1,120 of 2,000 parts, 2.00 a second, 3 with an error, about 7 min left"
    ]


@pytest.mark.parametrize("total", [1, 3])
def test_a_terminal_shows_the_step_of_a_single_part_too(total: int, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with Progress() as progress:
        progress.start(total)
        progress.step("drawing the [report]")
        progress._bar.refresh()
        progress.advance()
    assert "drawing the [report]" in terminal.getvalue()
    assert ("0/3" in terminal.getvalue()) == (total == 3)
