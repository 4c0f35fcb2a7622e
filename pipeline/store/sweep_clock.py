"""Check the clock before a sweep: old files are deleted, so a clock that leaps ahead must not make files look old.

evidence/swept      its time is that of the last sweep
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import structlog

MOST_GAP_S = 31 * 86_400.0
"""Maximum plausible time between two sweeps, seconds: a plant that stands still for a month."""
MOST_DRIFT_S = 600.0
"""Maximum drift of the clock against the monotonic one between two sweeps, seconds: more is a leap, which would make
unfinished files look old."""
log = structlog.get_logger("tactile-marks")


@dataclass
class SweepClock:
    """Plausibility check of the clock before every sweep.

    Attributes:
        file: keeps the time of the last sweep; it need not be there.
        wall_s, monotonic_s: clocks.
        trouble: why nothing is swept, without paths; empty if sweeping is allowed.
    """

    file: Path
    wall_s: Callable[[], float] = time.time
    monotonic_s: Callable[[], float] = time.monotonic
    trouble: str = field(default="", init=False)
    _before: tuple[float, float] | None = field(default=None, init=False)

    def may_sweep(self, newest: datetime | None) -> bool:
        """Whether to sweep now; if so, this is the last sweep from now on.

        Args:
            newest: when the latest part came, by which the clock is judged before there was any sweep.

        Raises:
            OSError: the file cannot be written.
        """
        now_s = self.wall_s()
        before, self._before = self._before, (now_s, self.monotonic_s())
        if not self.file.exists():
            self.file.touch(mode=0o600)
            first_s = now_s if newest is None else min(now_s, newest.timestamp())
            os.utime(self.file, (first_s, first_s))
        gap_s = now_s - self.file.stat().st_mtime
        self.trouble = ""
        if gap_s > MOST_GAP_S:
            self.trouble = (
                f"nothing is deleted: by the clock the last sweep was {gap_s / 86_400.0:,.0f} days ago"
            )
            hint = f"set the clock; if it is right, run: touch {self.file}"
            log.warning("not swept", why=self.trouble, hint=hint)
            return False
        if before is not None:
            leap_s = now_s - before[0] - (self._before[1] - before[1])
            if abs(leap_s) > MOST_DRIFT_S:
                self.trouble = f"nothing is deleted this time: the clock has leapt by {leap_s:,.0f} s"
                log.warning("not swept", why=self.trouble)
                return False
        if gap_s > 0.0:
            os.utime(self.file, (now_s, now_s))
        return True
