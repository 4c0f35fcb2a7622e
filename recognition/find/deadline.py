"""Time limit of a part: a search that reaches it stops, and what was read so far counts."""

from __future__ import annotations

from time import monotonic


class Deadline:
    """Time from which a part is not looked at any more; `stopped` is then why."""

    def __init__(self, limit_s: float | None = None) -> None:
        self.stopped = ""
        self._limit_s, self._start_s = limit_s, monotonic()

    def is_over(self) -> bool:
        """Whether the time is over. Ask only before work that is then left out: the answer is kept as `stopped`."""
        if self._limit_s is not None and monotonic() - self._start_s >= self._limit_s:
            self.stopped = f"stopped after {self._limit_s:g} s"
        return bool(self.stopped)
