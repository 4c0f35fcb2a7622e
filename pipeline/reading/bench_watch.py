"""Monitor recordings for faults of whiskers and bench; report a fault while several recent parts show it."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence

ALERT = "bench"
LATEST = 3  # most recent scanned parts that are checked
SHOWN_BY = 2  # of these must show a fault before it is reported: dirt on one part may look like a fault


class BenchWatch:
    """Faults of the most recent scanned parts."""

    def __init__(self) -> None:
        self._latest: deque[dict[str, str]] = deque(maxlen=LATEST)
        self.parts = 0

    def add(self, faults: Sequence[str]) -> bool:
        """Add a scanned part's faults, such as "whisker 3, dead whisker: gives ..."; whether they raise a new alert."""
        before = self.message()
        self._latest.append({text.partition(":")[0]: text for text in faults})
        self.parts += 1
        return bool(self.message()) and not before

    def status(self) -> str | None:
        return self.message() if self.parts else None

    def message(self) -> str:
        count = Counter(name for part in self._latest for name in part)
        latest = {name: text for part in self._latest for name, text in part.items()}
        return "; ".join(latest[name] for name in sorted(count) if count[name] >= SHOWN_BY)
