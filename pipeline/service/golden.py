"""The golden part: a part of known relief, scanned once per shift to measure the wear of the whiskers."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from pipeline.common.golden_record import GoldenRecord, wear_messages
from pipeline.reading.golden import measure_sent
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import Upload
from pipeline.service.worker_calls import WorkerCalls
from pipeline.store.alerts import MOST_SCANS
from pipeline.store.store import Store

if TYPE_CHECKING:
    from pipeline.service.settings import GoldenSettings

GOLDEN, OVERDUE = "golden", "golden_overdue"


class GoldenPart:
    """The golden part of a line. Its first scan is the reference, or a later one that is sent as such."""

    def __init__(self, settings: GoldenSettings, store: Store, calls: WorkerCalls, *, line: str) -> None:
        self._store, self._calls, self._relief, self._line = store, calls, settings.relief, line
        self._every = timedelta(hours=settings.every_h)

    async def measure(self, sent: Upload, *, reference: bool) -> GoldenRecord:
        """Measure and store a scan. Raises Problem: 409, no golden part is set up; 422, the file is no scan of it."""
        if self._relief is None:
            raise Problem(
                409, 'no golden part is set up; name its relief: relief = "golden.npz" under [service.golden]'
            )
        measures = await self._calls.call(measure_sent, sent.path, sent.name, self._relief)
        return await asyncio.to_thread(self._store.add_golden, measures, line=self._line, reference=reference)

    def scans(self, *, limit: int = MOST_SCANS) -> tuple[GoldenRecord, ...]:
        return self._store.golden_scans(self._line, limit=limit)

    def worn(self, scans: tuple[GoldenRecord, ...]) -> tuple[str, ...]:
        reference = next((scan for scan in scans if scan.reference), None)
        return wear_messages(scans[0], reference) if reference is not None else ()

    def faults(self) -> dict[str, str | None]:
        """Alerts by name: the problem; empty if all is well, None if unknown."""
        if self._relief is None:
            return {}
        scans = self.scans(limit=1)
        faults: dict[str, str | None] = {GOLDEN: "; ".join(self.worn(scans)) if scans else None}
        if self._every:
            late = not scans or datetime.now(UTC) - scans[0].at > self._every
            hours = self._every.total_seconds() / 3600.0
            faults[OVERDUE] = f"the golden part was not scanned for {hours:g} h; scan it" if late else ""
        return faults
