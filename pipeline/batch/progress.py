"""How far a run is: a bar or a clock on a terminal, a line a minute elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any

from pipeline.common.row import Row

LINE_EVERY_S = 60.0


class Progress:
    """Called with the row of every part that is read; on standard error."""

    def __init__(self, total: int, *, done: int = 0) -> None:
        """Begin.

        Args:
            total: parts of the run.
            done: of these read in an earlier sitting.
        """
        self._total, self._done, self._before, self._unread = total, done, done, 0
        self._bar: Any = None
        self._task: Any = None
        self._began_s = self._shown_s = time.monotonic()

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                SpinnerColumn,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )

            step = TextColumn("{task.description}", markup=False)
            columns = (
                (step, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
                if self._total > 1
                else (SpinnerColumn(), step, TimeElapsedColumn())
            )
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("reading", total=self._total, completed=self._done)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def step(self, what: str) -> None:
        """Show what is being done just now, such as "compiling kernels, once per machine"."""
        if self._bar is not None:
            self._bar.update(self._task, description=what)
        else:
            print(what, file=sys.stderr, flush=True)

    def __call__(self, row: Row) -> None:
        """One part more is read."""
        self._done += 1
        self._unread += bool(row.error)
        if self._bar is not None:
            self._bar.update(self._task, advance=1, description="reading")
            return
        now = time.monotonic()
        if now - self._shown_s >= LINE_EVERY_S and self._done < self._total:
            self._shown_s = now
            rate = (self._done - self._before) / (now - self._began_s)
            left_min = (self._total - self._done) / rate / 60.0
            print(
                f"{self._done:,} of {self._total:,} parts, {rate:.2f} a second, {self._unread:,} with an error,"
                f" about {left_min:.0f} min left",
                file=sys.stderr,
                flush=True,
            )
