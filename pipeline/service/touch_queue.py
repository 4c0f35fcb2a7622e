"""Parts that wait for touch: felt while they are known to lie under the whiskers, else left to a person.

    touch_needed --trigger's own call------> attempt --felt---> accepted, review
        |                                      \\--failed, late--> review
        |--release by a person or controller-> attempt --failed--> it still waits
        |--driver says that it is in place---> attempt --failed--> tried again: retry_s later
        \\-- until its time is up, or the service ends during the call --> review, by a person

* No part is felt unasked: by then another may lie there. Only a driver with `is_in_place` can say that it still does.
* There is one attempt at a time per part; further callers get the result of that attempt.
* After the first check the monotonic clock measures the time limit, so a jump of the system clock does not matter.
* Services that share a store feel only the parts of their own lines; any of them gives up any part whose time is up.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import KW_ONLY, dataclass, field
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import structlog

from pipeline.service.stage.work import NO_LIMIT, TouchCall
from pipeline.service.tasks import end_tasks
from pipeline.service.web.problem import Problem
from pipeline.store.errors import ConflictError, StoreError
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.common.records import PartRecord
    from pipeline.store.store import Store

# time between two attempts at a part, s
RETRY_S = 15.0
# attempts in progress, requested ones included, from which the queue starts no further one; a real stage feels
# one part at a time anyway
AT_ONCE = 4
NOBODY = "nobody has felt it in time"
STOPPED = "the service was stopped before the stage had felt it"
log = structlog.get_logger("tactile-marks")


@dataclass
class TouchQueue:
    """Let the stage feel waiting parts."""

    store: Store
    # keeps what was read; raises Problem, StageError
    feel: Callable[[PartRecord, TouchCall], Awaitable[PartRecord]]
    _: KW_ONLY
    give_up: Callable[[PartRecord, str], Awaitable[object]]  # leave a part to a person, and say why
    line: str = ""
    stage: str = ""
    knows_place: bool = False  # the stage can say whether a part lies under the whiskers
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
        return datetime.now(UTC) + timedelta(seconds=self.wait_s)

    async def attempt(self, part: PartRecord, call: TouchCall = NO_LIMIT) -> PartRecord:
        """Feel a part under the whiskers, or wait for the running attempt. Raises Problem, StageError: not felt."""
        attempt = self._attempts.get(part.id)
        if attempt is None:
            attempt = self._attempts[part.id] = asyncio.create_task(self._attempt(part.id, call))
        # a cancelled caller does not stop the attempt
        return await asyncio.shield(attempt)

    async def begin(self) -> None:
        """Give up the parts of this line whose calls have ended with an earlier process."""
        for waiting in await asyncio.to_thread(self.store.waiting_for_touch):
            if waiting.by_stage and waiting.line == self.line and not self.knows_place:
                await self._give_up(waiting.part_id, STOPPED)

    async def look(self) -> None:
        """Check once: give up parts that have waited for too long, and start due attempts."""
        now = time.monotonic()
        waiting = {(w.part_id, w.until): w for w in await asyncio.to_thread(self.store.waiting_for_touch)}
        self._deadlines = {
            key: self._deadlines.get(key, now + self._left_s(part.changed_at, part.until))
            for key, part in waiting.items()
        }
        # a part that another service or a person has dealt with waits no more
        waits = self._attempts.keys() | {part.part_id for part in waiting.values()}
        self._failures = {part_id: why for part_id, why in self._failures.items() if part_id in waits}
        for (part_id, _), deadline in self._deadlines.items():
            if deadline <= now and part_id not in self._attempts:
                await self._give_up(part_id, NOBODY)
        for part in waiting.values() if self.knows_place else ():
            _, rest_until_s = self._failures.get(part.part_id, ("", 0.0))
            due = part.part_id not in self._attempts and rest_until_s <= now
            if part.by_stage and part.line == self.line and due and len(self._attempts) < AT_ONCE:
                attempt = self._attempts[part.part_id] = asyncio.create_task(self._attempt(part.part_id))
                attempt.add_done_callback(_log_unexpected)

    async def stop(self) -> None:
        await end_tasks(self._attempts.values())

    async def _attempt(self, part_id: str, call: TouchCall = NO_LIMIT) -> PartRecord:
        part: PartRecord | None = None
        try:
            part = await asyncio.to_thread(self.store.part, part_id)
            if part.plan is not None:  # else it was felt or reviewed meanwhile
                part = await self.feel(part, call)
        except Exception as error:
            (before, _), why = self._failures.get(part_id, ("", 0.0)), str(error)
            if part is not None and why not in ("", before):
                await self._note_failure(part, error)
            if part is not None and part.touch is not None and self.knows_place:
                self._failures[part_id] = why, time.monotonic() + self.retry_s
            elif part is not None and part.touch is not None and part.touch.by_stage:
                await self._give_up(part_id, f"the stage has not felt it: {why}")
            raise
        else:
            self._failures.pop(part_id, None)
            return part
        finally:
            del self._attempts[part_id]

    async def _note_failure(self, part: PartRecord, error: Exception) -> None:
        touch, left = part.touch, dict[str, int]()
        if touch is not None and self.knows_place:
            left["waits_another_s"] = round(self._left_s(part.changed_at, touch.until))
        log.warning("part not felt", part=part.id, name=part.name, why=str(error), stage=self.stage, **left)
        if isinstance(error, StageError):
            await asyncio.to_thread(self.store.note_event, part.id, "touch_failed", {"why": str(error)})

    def _left_s(self, since: datetime, until: datetime | None) -> float:
        """Seconds that a part may still wait; never more than its limit, even if the clock is wrong."""
        if until is None:
            until = since + timedelta(seconds=self.wait_s)
        return max(0.0, min((until - datetime.now(UTC)).total_seconds(), (until - since).total_seconds()))

    async def _give_up(self, part_id: str, why: str) -> None:
        self._failures.pop(part_id, None)
        try:
            part = await asyncio.to_thread(self.store.part, part_id)
            await self.give_up(part, why)
        except ConflictError:
            return  # it was felt, reviewed or given up by another service meanwhile
        except StoreError:
            raise
        except Exception:  # one part must not keep the others waiting
            log.exception("waiting part could not be handed to a person", part=part_id)
        else:
            log.warning("part not felt, handed to a person", part=part.id, name=part.name, why=why)


def _log_unexpected(attempt: asyncio.Task[PartRecord]) -> None:
    error = None if attempt.cancelled() else attempt.exception()
    if error is not None and not isinstance(error, Problem | StageError | StoreError):
        log.error("attempt at touch failed", exc_info=error)
