"""Time stamps and units of time in trace tables."""

from __future__ import annotations

import re
from enum import StrEnum

DAY_S = 86_400.0
_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*([AaPp])?")


class TimeUnit(StrEnum):
    """Unit of a time column."""

    SECOND = "s"
    MILLISECOND = "ms"
    MICROSECOND = "us"
    NANOSECOND = "ns"
    DAY = "d"

    @property
    def seconds(self) -> float:
        """One of it."""
        return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": DAY_S}[self.value]


def second_of_day(written: str) -> float | None:
    """Second of the day of a time stamp, such as 2024-03-01T09:30:00.125 or 9:30:00 PM; None of anything else."""
    found = _OF_DAY.search(written)
    if found is None:
        return None
    hours, minutes, seconds, half = found.groups()
    hour = int(hours) if half is None else int(hours) % 12 + (12 if half in "Pp" else 0)
    return 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))
