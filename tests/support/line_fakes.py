"""Parts, an outbox, and waiting: for the tests of what stands at the line."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import threading
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Any, Self

from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.records import PartRecord, PartState
from pipeline.store.errors import NotFoundError
from pipeline.store.store import Store
from tests.support.store_samples import correct
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


class Outbox(Store):
    """A store of parts that are to be sent; it notes what was postponed."""

    @functools.cached_property
    def postponed(self) -> list[tuple[str, float]]:
        """Why and for how long, in order."""
        return []

    def put(self, number: int, text: str, *targets: str) -> None:
        """Have the part of a number sent: at first as it was read, then as it is corrected."""
        part_id = f"{number:026}"
        try:
            correct(self, part_id, text, targets=targets)
        except NotFoundError:
            read = (reading(text),)
            self.add_part(part_id=part_id, name="", state=PartState.ACCEPTED, readings=read, targets=targets)

    def fill(self, parts: int, each: int, *targets: str) -> Self:
        """Put so many parts into it, each again and again."""
        for number in range(each):
            for index in range(parts):
                self.put(index, f"TEXT{number}", *targets)
        return self

    def postpone(self, delivery_id: int, owner: str, *, error: str, wait_s: float) -> None:
        self.postponed.append((error, wait_s))
        super().postpone(delivery_id, owner, error=error, wait_s=wait_s)


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
