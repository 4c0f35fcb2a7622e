"""What leaves the service by itself: deliveries of the store's outbox, sent until they have arrived.

outbox --lease--> sender (webhook, MQTT) --arrived--> delivered
                                         \\-failed---> postponed: 1, 2, 4 ... 300 s, less a random share

A delivery is taken from the outbox only once the other side has said that it has it, so each arrives at least once;
twice if the service dies between the two. The results of one part arrive in their order: the outbox gives only the
eldest of each part and target, so later ones wait behind it. A target that is away is not tried with everything that
is due: it rests, and is then tried with one.

Services that share a store share its outbox: what one has leased the others leave alone, and nothing is begun to be
sent that might not end within the lease. A service that dies loses nothing; another has it when the lease is over. One
that stands still in the middle of a sending, for longer than its lease, may send late what another has sent since:
receivers that mind drop what has a smaller delivery_id than they have had of that part.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Protocol

import numpy as np

from glyphs.errors import MarksError
from pipeline.common.records import Delivery, WaitingResults

_MOST_REFUSED = 100
"""Refused results that are kept in mind for each target; all of them wait in the outbox."""
_log = logging.getLogger(__name__)


class DeliveryError(MarksError):
    """A delivery that has not arrived.

    Attributes:
        away: the target cannot be reached at all, so others need not be tried now.
        lasting: somebody has to change something; there is no use in trying soon.
        retry_after_s: the target's own wish; 0 where it has none.
    """

    def __init__(
        self,
        what: str,
        *,
        hint: str = "",
        away: bool = False,
        lasting: bool = False,
        retry_after_s: float = 0.0,
    ) -> None:
        super().__init__(what, hint=hint)
        self.away, self.lasting, self.retry_after_s = away, lasting, retry_after_s


class Sender(Protocol):
    """Brings deliveries to one target."""

    def start(self, report: Callable[[str], object]) -> None:
        """Begin, in the running loop.

        Args:
            report: to be called with why the target cannot be reached, or with an empty string when it can.
        """

    async def send(self, delivery: Delivery) -> None:
        """Return once the target has the delivery.

        Raises:
            DeliveryError: it has it not, or not for sure.
        """

    async def close(self) -> None:
        """Take leave of the target."""


class Outbox(Protocol):
    """Where deliveries wait: `pipeline.store.store.Store` is one. All of it may block."""

    def lease(
        self, owner: str, targets: Collection[str], *, lease_s: float, limit: int = 100
    ) -> tuple[Delivery, ...]:
        """Deliveries whose time has come, longest due first, for one owner until the lease ends."""

    def release(self, owner: str, delivery_ids: Collection[int]) -> None:
        """Leave deliveries to whoever comes first."""

    def delivered(self, delivery_id: int) -> None:
        """Forget a delivery."""

    def postpone(self, delivery_id: int, owner: str, *, error: str, wait_s: float) -> None:
        """Count an attempt in vain; the delivery is not due before that wait is over."""

    def waiting_results(self) -> Mapping[str, WaitingResults]:
        """Deliveries that wait to be sent, by target."""


@dataclass(frozen=True)
class TargetState:
    """Whether a target can be reached, and what it refuses.

    Attributes:
        since: when it became so.
        error: why it cannot be reached; empty while it can, as far as is known.
        refused: why it does not take results, by their numbers.
    """

    since: datetime
    error: str = ""
    refused: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Pace:
    """How hard a dispatcher tries.

    Attributes:
        batch: deliveries to one target leased together.
        together: sent to one target at the same time, of different parts.
        look_s: between two looks at the outbox when nothing wakes the dispatcher.
        first_wait_s: before the second attempt; doubled with every further one.
        longest_wait_s: between two attempts.
        longest_rest_s: of a target that is away.
        send_s: for one attempt, whatever the sender's own limits.
        lease_s: for which other services leave a delivery alone; longer than `send_s`.
    """

    batch: int = 100
    together: int = 4
    look_s: float = 1.0
    first_wait_s: float = 1.0
    longest_wait_s: float = 300.0
    longest_rest_s: float = 30.0
    send_s: float = 60.0
    lease_s: float = 120.0

    def __post_init__(self) -> None:
        if self.lease_s <= self.send_s:
            raise ValueError(
                f"a lease of {self.lease_s:g} s ends before an attempt of {self.send_s:g} s may; give more"
            )

    def wait_s(self, attempts: int) -> float:
        """Before the next attempt, after `attempts` in vain."""
        return min(self.longest_wait_s, self.first_wait_s * 2.0 ** min(attempts - 1, 60))


class Dispatcher:
    """Sends what waits in the outbox.

    Attributes:
        sent, failed: deliveries and attempts in vain by target, since the start.
        states: of the targets.
    """

    def __init__(
        self,
        outbox: Outbox,
        senders: Mapping[str, Sender],
        *,
        rng: np.random.Generator | None = None,
        pace: Pace | None = None,
    ) -> None:
        self.sent: Counter[str] = Counter()
        self.failed: Counter[str] = Counter()
        self.states = {target: TargetState(datetime.now(UTC)) for target in senders}
        self._outbox, self._senders = outbox, dict(senders)
        self._rng = rng if rng is not None else np.random.default_rng()
        self._pace = pace or Pace()
        self._resting: dict[str, tuple[float, int]] = {}  # target: until (loop's time), failures in a row
        self._busy: dict[str, asyncio.Task[None]] = {}
        self._owner = secrets.token_hex(8)  # not from the rng: services seeded alike are two all the same
        self._leased: set[int] = set()
        self._woken = asyncio.Event()
        self._stopping = False
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin, in a task of the running loop."""
        for target, sender in self._senders.items():
            sender.start(partial(self._report, target))
        self._task = asyncio.create_task(self._run(), name="dispatcher")

    def wake(self) -> None:
        """Look at the outbox now; call it after something was put there, from the loop's own thread."""
        self._woken.set()

    async def stop(self, *, grace_s: float = 10.0) -> None:
        """End: what is being sent gets `grace_s`; what has not arrived waits in the outbox for the next start."""
        self._stopping = True
        self._woken.set()
        tasks = {*self._busy.values(), *((self._task,) if self._task is not None else ())}
        if tasks:
            await asyncio.wait(tasks, timeout=grace_s)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        with contextlib.suppress(Exception):  # else they are the others' when the lease is over
            await self._release(tuple(self._leased))
        await asyncio.gather(*(sender.close() for sender in self._senders.values()), return_exceptions=True)

    async def _run(self) -> None:
        troubles, said = 0, False
        while not self._stopping:
            self._woken.clear()
            pause_s = self._pace.look_s
            try:
                if not said:
                    await self._say_what_nobody_sends()
                    said = True
                await self._look()
                troubles = 0
            except Exception:  # the store is away, say; a dispatcher that ends would be noticed by nobody
                troubles += 1
                if troubles == 1:
                    _log.exception("the outbox cannot be used; trying again")
                pause_s = min(self._pace.wait_s(troubles), self._pace.longest_rest_s)
            if not self._stopping:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._woken.wait(), pause_s)

    async def _look(self) -> None:
        """Have every target served that has something due, does not rest and is not being served."""
        free = [target for target in self._senders if target not in self._busy and not self._rests(target)]
        if not free or self._stopping:
            return
        until_s = asyncio.get_running_loop().time() + self._pace.lease_s
        leased = await asyncio.to_thread(
            self._outbox.lease, self._owner, free, lease_s=self._pace.lease_s, limit=self._pace.batch
        )
        self._leased.update(delivery.id for delivery in leased)
        by_target: dict[str, list[Delivery]] = {}
        for delivery in leased:
            by_target.setdefault(delivery.target, []).append(delivery)
        for target, deliveries in by_target.items():
            self._busy[target] = asyncio.create_task(self._serve(target, deliveries, until_s))

    async def _say_what_nobody_sends(self) -> None:
        for target in sorted(set(await asyncio.to_thread(self._outbox.waiting_results)) - set(self._senders)):
            _log.warning("results wait to be sent to %s, which is not set up here", target)

    def _rests(self, target: str) -> bool:
        until, _ = self._resting.get(target, (0.0, 0))
        return until > asyncio.get_running_loop().time()

    async def _serve(self, target: str, deliveries: Sequence[Delivery], until_s: float) -> None:
        """Send what is leased for a target, while the lease lasts."""
        sender = self._senders[target]
        waiting = list(reversed(deliveries))
        loop = asyncio.get_running_loop()

        async def work() -> None:
            while waiting and not self._stopping and not self._rests(target):
                if loop.time() + self._pace.send_s > until_s:
                    return
                await self._send(sender, waiting.pop())

        try:
            if target in self._resting:  # its rest is over: try with one
                await self._send(sender, waiting.pop())
            await asyncio.gather(*(work() for _ in range(self._pace.together)))
            await self._release(tuple(delivery.id for delivery in waiting))
        except Exception:  # the store: what was sent is sent again
            _log.exception("the outbox cannot be used; %s rests", target)
            self._rest(target, DeliveryError("the outbox cannot be used"))
        finally:
            del self._busy[target]
            if not self._rests(target):
                self._woken.set()  # there may be more

    async def _send(self, sender: Sender, delivery: Delivery) -> None:
        target = delivery.target
        try:
            async with asyncio.timeout(self._pace.send_s):
                await sender.send(delivery)
        except TimeoutError:
            await self._failed(delivery, DeliveryError("no answer in time", away=True))
            return
        except DeliveryError as error:
            await self._failed(delivery, error)
            return
        except Exception as error:
            _log.exception("the %s sender failed on a delivery of part %s", target, delivery.part_id)
            await self._failed(delivery, DeliveryError(f"{type(error).__name__}: {error}"))
            return
        self._report(target, "")
        self._note_refusal(delivery, "")
        self._resting.pop(target, None)
        self.sent[target] += 1
        await asyncio.to_thread(self._outbox.delivered, delivery.id)
        self._leased.discard(delivery.id)

    async def _failed(self, delivery: Delivery, error: DeliveryError) -> None:
        target, pace = delivery.target, self._pace
        self.failed[target] += 1
        self._report(target, str(error) if error.away else "")
        if not error.away:
            if not delivery.attempts:  # once, not with every attempt
                _log.warning("%s does not take the result of part %s: %s", target, delivery.part_id, error)
            self._note_refusal(delivery, str(error))
        if error.away:
            self._rest(target, error)
            wait_s = self._resting[target][0] - asyncio.get_running_loop().time()
        else:
            wait_s = pace.longest_wait_s if error.lasting else pace.wait_s(delivery.attempts + 1)
            wait_s = min(max(self._jittered(wait_s), error.retry_after_s), pace.longest_wait_s)
        await self._postpone(delivery, str(error), wait_s)

    def _report(self, target: str, error: str) -> None:
        """Note whether a target can be reached, and log it where that has changed."""
        before = self.states[target]
        if error and not before.error:
            _log.warning("%s is away, its results wait: %s", target, error)
        elif before.error and not error:
            _log.info("%s is back", target)
        since = before.since if bool(error) == bool(before.error) else datetime.now(UTC)
        self.states[target] = replace(before, since=since, error=error)

    def _note_refusal(self, delivery: Delivery, error: str) -> None:
        state = self.states[delivery.target]
        refused = {number: why for number, why in state.refused.items() if number != delivery.id}
        if error and len(refused) < _MOST_REFUSED:
            refused[delivery.id] = error
        if refused != state.refused:
            self.states[delivery.target] = replace(state, refused=refused)

    def _rest(self, target: str, error: DeliveryError) -> None:
        if self._rests(target):
            return  # of several that fail together, one counts
        pace = self._pace
        _, failures = self._resting.get(target, (0.0, 0))
        longest_s = pace.longest_wait_s if error.lasting or error.retry_after_s else pace.longest_rest_s
        rest_s = longest_s if error.lasting else min(pace.wait_s(failures + 1), longest_s)
        rest_s = min(max(self._jittered(rest_s), error.retry_after_s), longest_s)
        self._resting[target] = (asyncio.get_running_loop().time() + rest_s, failures + 1)

    async def _postpone(self, delivery: Delivery, error: str, wait_s: float) -> None:
        await asyncio.to_thread(self._outbox.postpone, delivery.id, self._owner, error=error, wait_s=wait_s)
        self._leased.discard(delivery.id)

    async def _release(self, delivery_ids: Collection[int]) -> None:
        if delivery_ids:
            await asyncio.to_thread(self._outbox.release, self._owner, delivery_ids)
        self._leased.difference_update(delivery_ids)

    def _jittered(self, wait_s: float) -> float:
        return wait_s * float(self._rng.uniform(0.5, 1.0))


def body_of(delivery: Delivery) -> bytes:
    """What is sent: the payload and the delivery's number, as compact JSON in UTF-8."""
    content = {**delivery.payload, "delivery_id": delivery.id}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")
