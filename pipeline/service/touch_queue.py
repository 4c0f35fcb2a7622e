"""Parts that wait for touch, until they are felt or a person gets them.

    touch_needed --the stage is to feel it--> attempt --felt-----> accepted, review
        |                 ^                      \\--failed, busy--> tried again: retry_s later
        \\-- until its time is up ----------------------------------> review, by a person

* Waiting parts are kept in the store, so a request for touch outlives a kill: the service's next start continues it.
* There is one attempt at a time per part; further callers get the result of that attempt.
* A part is tried until its time limit, then given up: no part waits for ever, whether the stage or the sender was to
  feel it. The limit is kept in the store. After the first check the monotonic clock measures it, so a jump of the
  system clock does not matter.
* The log and the part's page say why a part was not felt yet and how long it waits; the history records stage faults;
  /readyz says how many wait, and how long.
* Services that share a store feel only the parts of their own lines; any of them gives up any part.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import KW_ONLY, dataclass, field
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import structlog

from pipeline.service.tasks import end_tasks
from pipeline.service.web.problem import Problem
from pipeline.store.errors import ConflictError, StoreError
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.common.records import PartRecord, TouchWait
    from pipeline.store.store import Store

RETRY_S = 15.0
"""Time between two attempts at a part, s."""
AT_ONCE = 4
"""Attempts in progress, requested ones included, from which the queue starts no further one; a real stage feels one
part at a time anyway."""
NOBODY = "nobody has felt it in time"
log = structlog.get_logger("tactile-marks")


@dataclass
class TouchQueue:
    """Let the stage feel waiting parts.

    Attributes:
        store: store of the waiting parts.
        feel: has the stage feel a part, and keeps what was read; raises Problem, StageError.
        give_up: leaves a part to a person, and says why.
        line: line whose parts the stage feels.
        stage: folder, bench or driver of the stage, for the log.
        wait_s: time that a part waits.
        retry_s: time between two attempts at a part.
    """

    store: Store
    feel: Callable[[PartRecord], Awaitable[PartRecord]]
    _: KW_ONLY
    give_up: Callable[[PartRecord, str], Awaitable[object]]
    line: str = ""
    stage: str = ""
    wait_s: float = 900.0
    retry_s: float = RETRY_S
    _deadlines: dict[tuple[str, datetime | None], float] = field(default_factory=dict, init=False)
    _attempts: dict[str, asyncio.Task[PartRecord]] = field(default_factory=dict, init=False)
    # why a part was not felt, and when to try again by the monotonic clock
    _failures: dict[str, tuple[str, float]] = field(default_factory=dict, init=False)

    @property
    def trouble(self) -> str:
        """Waiting parts that the stage could not feel yet, in words without names; empty without one."""
        untils_s = [until_s for (part, _), until_s in self._deadlines.items() if part in self._failures]
        if not untils_s:
            return ""
        n, left_s = len(untils_s), max(0.0, min(untils_s) - time.monotonic())
        parts = "1 part waits for the stage; it" if n == 1 else f"{n} parts wait for the stage; the first"
        return f"{parts} is given up in {left_s:.0f} s; its page and the log say why"

    def until(self) -> datetime:
        """Deadline of a part that starts to wait now."""
        return datetime.now(UTC) + timedelta(seconds=self.wait_s)

    async def attempt(self, part: PartRecord) -> PartRecord:
        """Attempt to feel a part, or wait for the running attempt; return the part afterwards.

        Raises:
            Problem, StageError: it could not be felt; it still waits, and is tried again.
        """
        attempt = self._attempts.get(part.id)
        if attempt is None:
            attempt = self._attempts[part.id] = asyncio.create_task(self._attempt(part.id))
        # a cancelled caller does not stop the attempt
        return await asyncio.shield(attempt)

    async def look(self) -> None:
        """Check once: give up parts that have waited for too long, and start due attempts."""
        now = time.monotonic()
        waiting = {(w.part_id, w.until): w for w in await asyncio.to_thread(self.store.waiting_for_touch)}
        self._deadlines = {
            key: self._deadlines.get(key, now + self._left_s(one.changed_at, one.until))
            for key, one in waiting.items()
        }
        for (part_id, _), deadline in self._deadlines.items():
            if deadline <= now and part_id not in self._attempts:
                await self._given_up(part_id)
        for one in waiting.values():
            _, rest_until_s = self._failures.get(one.part_id, ("", 0.0))
            due = one.part_id not in self._attempts and rest_until_s <= now
            if one.by_stage and one.line == self.line and due and len(self._attempts) < AT_ONCE:
                attempt = self._attempts[one.part_id] = asyncio.create_task(self._attempt(one.part_id))
                attempt.add_done_callback(_looked_at)

    async def stop(self) -> None:
        """End the attempts; parts not felt wait in the store for the next start."""
        await end_tasks(self._attempts.values())

    async def _attempt(self, part_id: str) -> PartRecord:
        part: PartRecord | None = None
        try:
            part = await asyncio.to_thread(self.store.part, part_id)
            if part.touch is not None:  # else it was felt, reviewed or given up meanwhile
                part = await self.feel(part)
        except BaseException as error:
            (before, _), why = self._failures.get(part_id, ("", 0.0)), str(error)
            self._failures[part_id] = why, time.monotonic() + self.retry_s
            if part is not None and part.touch is not None and why not in ("", before):
                await self._say_failure(part, part.touch, error)
            raise
        else:
            self._failures.pop(part_id, None)
            return part
        finally:
            del self._attempts[part_id]

    async def _say_failure(self, part: PartRecord, touch: TouchWait, error: BaseException) -> None:
        left_s = round(self._left_s(part.changed_at, touch.until))
        told = {"why": str(error), "stage": self.stage, "waits_another_s": left_s}
        log.warning("part not felt yet", part=part.id, name=part.name, **told)
        if isinstance(error, StageError):
            await asyncio.to_thread(self.store.note_event, part.id, "touch_failed", {"why": str(error)})

    def _left_s(self, since: datetime, until: datetime | None) -> float:
        """Seconds that a part may still wait; never more than its limit, even if the clock is wrong."""
        if until is None:
            until = since + timedelta(seconds=self.wait_s)
        return max(0.0, min((until - datetime.now(UTC)).total_seconds(), (until - since).total_seconds()))

    async def _given_up(self, part_id: str) -> None:
        self._failures.pop(part_id, None)
        try:
            part = await asyncio.to_thread(self.store.part, part_id)
            await self.give_up(part, NOBODY)
        except ConflictError:
            return  # it was felt, reviewed or given up by another service meanwhile
        except StoreError:
            raise
        except Exception:  # one part must not keep the others waiting
            log.exception("waiting part could not be handed to a person", part=part_id)
        else:
            log.warning("part not felt in time, handed to a person", part=part.id, name=part.name, why=NOBODY)


def _looked_at(attempt: asyncio.Task[PartRecord]) -> None:
    """Log an unexpected error of an attempt without a waiting caller; the part's history has the expected ones."""
    error = None if attempt.cancelled() else attempt.exception()
    if error is not None and not isinstance(error, Problem | StageError | StoreError):
        log.error("attempt at touch failed", exc_info=error)
