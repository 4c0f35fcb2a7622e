"""Progress of a run on standard error: a bar or a clock on a terminal, otherwise one line per minute."""

from __future__ import annotations

import sys
import time
from typing import Any

LINE_EVERY_S = 60.0
_READING = "reading"


class Progress:
    """Show the progress of a run, from `start` to the end of its block."""

    _bar: Any = None
    _task: Any = None
    _total = _done = _before = _failed = 0
    _began_s = _shown_s = float("inf")

    def __enter__(self) -> Progress:
        return self

    def start(self, total: int, done: int = 0) -> None:
        self._total, self._done, self._before = total, done, done
        self._began_s = self._shown_s = time.monotonic()
        if not sys.stderr.isatty():
            return
        from rich import progress
        from rich.console import Console

        step = progress.TextColumn("{task.description}", markup=False)
        many = (step, progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeRemainingColumn())
        single = (progress.SpinnerColumn(), step, progress.TimeElapsedColumn())
        self._bar = progress.Progress(
            *(many if total > 1 else single),
            console=Console(stderr=True),
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._bar.add_task(_READING, total=total, completed=done)
        self._bar.start()

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def more(self, parts: int) -> None:
        self._total += parts
        if self._bar is not None:
            self._bar.update(self._task, total=self._total)

    def step(self, what: str) -> None:
        """Show the current step on a terminal until the next part is done: "drawing the report"."""
        if self._bar is not None:
            self._bar.update(self._task, description=what)

    def line(self, what: str) -> None:
        if self._bar is not None:
            self._bar.console.print(what, markup=False, highlight=False)
        else:
            print(what, file=sys.stderr, flush=True)

    def advance(self, *, failed: bool = False) -> None:
        self._done += 1
        self._failed += failed
        if self._bar is not None:
            self._bar.update(self._task, advance=1, description=_READING)
        elif self._done < self._total and time.monotonic() - self._shown_s >= LINE_EVERY_S:
            self._shown_s = time.monotonic()
            rate = (self._done - self._before) / (self._shown_s - self._began_s)
            left_min = (self._total - self._done) / rate / 60.0
            self.line(
                f"{self._done:,} of {self._total:,} parts, {rate:.2f} a second, {self._failed:,} with an error,"
                f" about {left_min:.0f} min left"
            )
