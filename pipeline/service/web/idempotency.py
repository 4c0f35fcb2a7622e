"""Idempotent requests: one with a key is carried out once, however often and at whatever times it is sent.

* While it is at work in this process, the same request waits for it; both get one answer.
* After a failure each of those that waited makes its own try.
* What other processes did, or this one before it was started anew, the store knows.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from pipeline.common.records import PartRecord
from pipeline.service.web.problem import Problem
from pipeline.store.store import AlreadyDoneError, IdempotencyKey, Store


@dataclass(frozen=True)
class Received:
    """What came of a request.

    Attributes:
        part: as it stands.
        replayed: whether the same request had been answered before.
    """

    part: PartRecord
    replayed: bool = False


class IdempotentRequests:
    """The requests that are at work in this process, by their keys."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._running: dict[str, asyncio.Future[PartRecord]] = {}

    async def carry_out(
        self, idempotency: IdempotencyKey | None, work: Callable[[], Awaitable[PartRecord]]
    ) -> Received:
        """Do the work, or find what came of it before.

        Args:
            idempotency: of the request; without one it is simply done.
            work: adds the part with the key in one transaction.

        Raises:
            Problem: the key was used for another request; whatever the work raises.
        """
        if idempotency is None:
            return Received(await work())
        running = self._running.get(idempotency.key)
        if running is not None:
            with contextlib.suppress(Problem):
                await asyncio.shield(running)
        known = await asyncio.to_thread(self._store.remembered, idempotency.key)
        if known is not None:
            return Received(await self._replayed(idempotency, *known), replayed=True)
        future: asyncio.Future[PartRecord] = asyncio.get_running_loop().create_future()
        self._running[idempotency.key] = future
        try:
            received = await self._tried(idempotency, work)
        except BaseException as error:
            # whatever it was: nobody may be left waiting
            future.set_exception(
                error if isinstance(error, Problem) else Problem(503, "the first try failed; send it again")
            )
            future.exception()  # looked at, so that nobody complains where none waits
            raise
        else:
            future.set_result(received.part)
            return received
        finally:
            if self._running.get(idempotency.key) is future:
                del self._running[idempotency.key]

    async def _tried(self, asked: IdempotencyKey, work: Callable[[], Awaitable[PartRecord]]) -> Received:
        try:
            return Received(await work())
        except AlreadyDoneError as error:
            # another process, or another that waited for a failure, was quicker
            part = await self._replayed(asked, error.fingerprint, error.part_id)
            return Received(part, replayed=True)

    async def _replayed(self, asked: IdempotencyKey, fingerprint: str, part_id: str) -> PartRecord:
        if fingerprint != asked.fingerprint:
            raise Problem(
                422, "this Idempotency-Key was used for another request; make a new one for every part"
            )
        return await asyncio.to_thread(self._store.part, part_id)
