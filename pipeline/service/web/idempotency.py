"""Idempotent requests: one with a key is carried out once, however often and at whatever times it is sent.

* While it is at work in this process, the same request waits for it; both get one answer.
* After a failure those that waited try one after the other.
* The store knows what other processes did, or this one before it was restarted.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from weakref import WeakValueDictionary

from pipeline.common.records import PartRecord
from pipeline.service.web.problem import Problem
from pipeline.store.errors import AlreadyDoneError
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store


@dataclass(frozen=True)
class Received:
    """The outcome of a request.

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
        # a lock lives as long as a request that holds it or waits for it
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()

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
        lock = self._locks.setdefault(idempotency.key, asyncio.Lock())
        async with lock:
            known = await asyncio.to_thread(self._store.find_request, idempotency.key)
            if known is None:
                try:
                    return Received(await work())
                except AlreadyDoneError as error:  # another process was quicker
                    known = error.fingerprint, error.part_id
        fingerprint, part_id = known
        if fingerprint != idempotency.fingerprint:
            raise Problem(
                422, "this Idempotency-Key was used for another request; make a new one for every part"
            )
        return Received(await asyncio.to_thread(self._store.part, part_id), replayed=True)
