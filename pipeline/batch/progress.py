"""How far a run is: a bar on a terminal, a line a minute elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any

from pipeline.common.row import Row

LINE_EVERY_S = 60.0


class Progress:
    """Told of every part that is read."""

    def __init__(self, total: int, *, done: int = 0) -> None:
        """Begin.

        Args:
            total: parts of the run.
            done: of these read in an earlier sitting.
        """
        self._total, self._done, self._before, self._unread = total, done, done, 0
        self._bar: Any = None
        self._task: Any = None
        self._began_s = self._told_s = time.monotonic()

    def __enter__(self) -> Progress:
        if self._total > 1 and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("reading"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("reading", total=self._total, completed=self._done)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, row: Row) -> None:
        """One part more is read."""
        self._done += 1
        self._unread += bool(row.error)
        if self._bar is not None:
            self._bar.advance(self._task)
            return
        now = time.monotonic()
        if now - self._told_s >= LINE_EVERY_S and self._done < self._total:
            self._told_s = now
            rate = (self._done - self._before) / (now - self._began_s)
            left_min = (self._total - self._done) / rate / 60.0
            print(
                f"{self._done:,} of {self._total:,} parts, {rate:.2f} a second, {self._unread:,} with an error,"
                f" about {left_min:.0f} min left",
                file=sys.stderr,
                flush=True,
            )
