"""A progress that counts what it is told."""

from __future__ import annotations

from pipeline.runs.progress import Progress


class Counted(Progress):
    """Counts parts; as an interrupt it ends the run after so many."""

    def __init__(self, *, stop_after: int | None = None) -> None:
        self.starts: list[tuple[int, int]] = []
        self.parts, self.failed, self._stop_after = 0, 0, stop_after

    def start(self, total: int, done: int = 0) -> None:
        self.starts.append((total, done))

    def advance(self, *, failed: bool = False) -> None:
        self.parts, self.failed = self.parts + 1, self.failed + failed
        if self.parts == self._stop_after:
            raise KeyboardInterrupt
