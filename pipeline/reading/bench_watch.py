"""Watches what recordings say of whiskers and bench: a fault is told while part after part shows it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

ALERT = "bench"
LATEST = 3
"""Felt parts that are looked at."""
SHOWN_BY = 2
"""Of them, how many show a fault before it is told: one part's dirt may look like one."""


class BenchWatch:
    """Remembers the faults of the latest felt parts.

    Attributes:
        parts: felt parts that were looked at.
    """

    def __init__(self) -> None:
        self._latest: deque[dict[str, str]] = deque(maxlen=LATEST)
        self.parts = 0

    def add(self, faults: Sequence[str]) -> bool:
        """Take one more felt part; whether it is with this one that there is something to be told.

        Args:
            faults: of its recording, "whisker 3, dead whisker: gives ..." or "spikes: ..."; nothing where it is sound.
        """
        before = self.message()
        self._latest.append({text.partition(":")[0]: text for text in faults})
        self.parts += 1
        return bool(self.message()) and not before

    def told(self) -> str | None:
        """The message; None before anything was felt."""
        return self.message() if self.parts else None

    def message(self) -> str:
        """What is wrong, for a person, as the latest part showed it; empty where nothing is."""
        names = {name for part in self._latest for name in part}
        told = [name for name in sorted(names) if sum(name in part for part in self._latest) >= SHOWN_BY]
        return "; ".join(next(part[name] for part in reversed(self._latest) if name in part) for name in told)
