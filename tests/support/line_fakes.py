"""Parts, an outbox in memory, and waiting: for the tests of what stands at the line."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord, to_json
from pipeline.common.records import Delivery, PartRecord, PartState, WaitingResults
from tests.support.waiting import wait_until

NOW = datetime(2026, 11, 21, 19, 0, tzinfo=UTC)
LONG_S = 60.0
"""Within which anything happens that happens at all; nothing is waited for that long where all is well."""


def reading(text: str = "KX407251", **changes: Any) -> ReadingRecord:
    characters = tuple(
        CharacterRecord((CandidateRecord(c, 0.99, 0.98),), (6.0 * i, 1.0, 6.0 * i + 4.0, 6.0))
        for i, c in enumerate(text)
    )
    made: dict[str, Any] = {
        "source": "fused",
        "text": text,
        "decision": "accept" if text else "reject",
        "confidence": 0.9984 if text else 0.0,
        "characters": characters,
        "font": "gothic",
        "height_mm": 5.0,
        "rotation_deg": -1.6,
        "seconds": 0.4,
        "at": NOW,
    }
    return ReadingRecord(**{**made, **changes})


def part(name: str = "P17", text: str = "KX407251", **changes: Any) -> PartRecord:
    state = PartState.ACCEPTED if text else PartState.REVIEW
    made: dict[str, Any] = {
        "id": "01KB0000000000000000000017",
        "name": name,
        "state": state,
        "text": text,
        "created_at": NOW,
        "changed_at": NOW,
        "reading": reading(text),
    }
    return PartRecord(**{**made, **changes})


class MemoryOutbox:
    """An outbox as the store's, in memory, for one dispatcher: of a part and a target only the eldest is due."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: dict[int, tuple[Delivery, datetime]] = {}
        self._next = 1
        self.failures: list[tuple[int, str]] = []

    def put(self, record: PartRecord, targets: Sequence[str]) -> None:
        with self._lock:
            for target in targets:
                delivery = Delivery(self._next, target, record.id, to_json(record))
                self._waiting[self._next] = (delivery, datetime.min.replace(tzinfo=UTC))
                self._next += 1

    def lease(
        self, owner: str, targets: Collection[str], *, lease_s: float, limit: int = 100
    ) -> tuple[Delivery, ...]:
        now = datetime.now(UTC)
        with self._lock:
            fronts: dict[tuple[str, str], int] = {}
            for number in sorted(self._waiting):
                delivery, _ = self._waiting[number]
                fronts.setdefault((delivery.target, delivery.part_id), number)
            ready = [self._waiting[n] for n in fronts.values() if self._waiting[n][1] <= now]
        ready.sort(key=lambda item: (item[1], item[0].id))
        of_targets = [[d for d, _ in ready if d.target == target][:limit] for target in targets]
        return tuple(delivery for found in of_targets for delivery in found)

    def release(self, owner: str) -> None:
        """Of one dispatcher alone: it is given what it had."""

    def waiting_results(self) -> dict[str, WaitingResults]:
        with self._lock:
            counts = Counter(delivery.target for delivery, _ in self._waiting.values())
        return {target: WaitingResults(n, NOW) for target, n in counts.items()}

    def delivered(self, delivery_id: int) -> None:
        with self._lock:
            self._waiting.pop(delivery_id, None)

    def postpone(self, delivery_id: int, owner: str, *, error: str, wait_s: float) -> None:
        until = datetime.now(UTC) + timedelta(seconds=wait_s)
        with self._lock:
            delivery, _ = self._waiting[delivery_id]
            again = Delivery(
                delivery.id, delivery.target, delivery.part_id, delivery.payload, delivery.attempts + 1
            )
            self._waiting[delivery_id] = (again, until)
            self.failures.append((delivery_id, error))

    def undelivered(self) -> int:
        with self._lock:
            return len(self._waiting)


async def until(holds: Callable[[], bool], *, why: str = "") -> None:
    """Wait until something holds; fail if it never does."""
    end = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < end, f"waited in vain {why}"
        await asyncio.sleep(0.01)


@contextlib.contextmanager
def serving(app: Any) -> Iterator[str]:
    """A web application on a real uvicorn, on a port of the loopback address; gives its URL."""
    import uvicorn

    config = uvicorn.Config(app, host="127.0.0.1", port=0, log_level="error", lifespan="off")
    config.timeout_graceful_shutdown = 1
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    wait_until(lambda: server.started, why="for the web server")
    try:
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(LONG_S)
