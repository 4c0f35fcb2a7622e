"""Send the deliveries of the store's outbox, with retries until they are confirmed.

outbox --lease--> sender (webhook, MQTT) --arrived--> delivered
                                         \\-failed---> postponed: 1, 2, 4 ... 300 s, less a random share

Each delivery arrives at least once, and the results of one part in order. A target that is down rests, and is then
tried with one delivery. Of services that share an outbox, one that stalls for longer than its lease may send late:
receivers for which that matters drop a delivery_id smaller than the last one of that part.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from random import Random
from typing import TYPE_CHECKING, Protocol

from glyphs.errors import MarksError
from pipeline.common.records import Delivery, WaitingResults
from pipeline.service.tasks import end_tasks

if TYPE_CHECKING:
    from pipeline.store.store import Store

# names of the targets of results, in words
TARGETS = {"mqtt": "MQTT broker", "webhook": "Webhook"}


@dataclass
class Connection:
    """One connection: a target of results, or a port that listens."""

    key: str
    name: str
    since: datetime
    address: str = ""  # of a listening port; empty for a target
    error: str = ""  # why a target cannot be reached; empty while it can, as far as is known
    # why a target does not take results, by their numbers
    refused: dict[int, str] = field(default_factory=dict)
    waiting: WaitingResults | None = None

    @property
    def why(self) -> str:
        return self.error or next(iter(self.refused.values()), "")

    @property
    def state(self) -> str:
        if self.error:
            return "cannot be reached"
        if n := len(self.refused):
            return f"refuses {n} {'result' if n == 1 else 'results'}"
        return f"listens at {self.address}" if self.address else "works"

    @property
    def summary(self) -> str:
        """The state without addresses and names, for callers without a token."""
        if not self.why:
            return self.state
        waiting = f", {self.waiting.n} results wait" if self.waiting else ""
        return f"{self.state} since {self.since:%Y-%m-%dT%H:%M:%SZ}{waiting}"


# most refused results that are remembered for each target; all of them wait in the outbox
_MOST_REFUSED = 100
_log = logging.getLogger(__name__)


class DeliveryError(MarksError):
    """A delivery that has not arrived."""

    def __init__(
        self,
        what: str,
        *,
        hint: str = "",
        away: bool = False,  # the target cannot be reached at all, so others need not be tried now
        lasting: bool = False,  # a person must correct something first, so that an early retry is useless
        retry_after_s: float = 0.0,  # the target's own wish; 0 where it has none
    ) -> None:
        super().__init__(what, hint=hint)
        self.away, self.lasting, self.retry_after_s = away, lasting, retry_after_s


class Sender(Protocol):
    """Send deliveries to one target."""

    async def ping(self) -> bool:
        """Check the target while there is nothing to send. Raises DeliveryError: it is away."""

    async def send(self, delivery: Delivery) -> None:
        """Return once the target has the delivery. Raises DeliveryError: it has not arrived, or may not have."""

    async def close(self) -> None: ...


@dataclass(frozen=True)
class Pace:
    """Waits and timeouts of a dispatcher, s; each further attempt waits twice as long."""

    together: int = 4  # deliveries of different parts leased and sent to one target at the same time
    look_s: float = 1.0  # between two looks at the outbox when nothing wakes the dispatcher
    first_wait_s: float = 1.0
    longest_wait_s: float = 300.0
    longest_rest_s: float = 30.0  # of a target that is down
    send_s: float = 60.0  # timeout of one attempt, whatever the sender's own limits
    lease_s: float = 120.0  # other services leave a delivery alone so long; longer than `send_s`

    def wait_s(self, attempts: int) -> float:
        return min(self.longest_wait_s, self.first_wait_s * 2.0 ** min(attempts - 1, 60))


class Dispatcher:
    """Send the deliveries in the outbox, with one task for each target; `states` are the targets' by their keys."""

    def __init__(
        self,
        outbox: Store,
        senders: Mapping[str, Sender],
        *,
        rng: Random | None = None,
        pace: Pace | None = None,
    ) -> None:
        self.states = {target: Connection(target, TARGETS[target], datetime.now(UTC)) for target in senders}
        self._outbox, self._senders = outbox, dict(senders)
        self._rng, self._pace = rng or Random(), pace or Pace()
        # not from the rng: services with the same seed need different names
        self._owner = secrets.token_hex(8)
        self._woken = {target: asyncio.Event() for target in senders}
        self._stopping = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        for target, sender in self._senders.items():
            self._tasks.append(asyncio.create_task(self._run(target, sender), name=f"dispatcher {target}"))
        self._tasks.append(asyncio.create_task(self._warn_of_unknown_targets()))

    def wake(self) -> None:
        """Check the outbox now; call this after adding to it, from the loop's own thread."""
        for woken in self._woken.values():
            woken.set()

    async def stop(self, *, grace_s: float = 10.0) -> None:
        """Stop: deliveries in progress get `grace_s`; unconfirmed ones stay in the outbox for the next start."""
        self._stopping.set()
        self.wake()
        await end_tasks(self._tasks, grace_s=grace_s)
        with contextlib.suppress(Exception):  # otherwise the leases end by themselves
            await asyncio.to_thread(self._outbox.release, self._owner)
        await asyncio.gather(*(sender.close() for sender in self._senders.values()), return_exceptions=True)

    async def _run(self, target: str, sender: Sender) -> None:
        pace, woken, loop = self._pace, self._woken[target], asyncio.get_running_loop()
        troubles = rests = 0
        while not self._stopping.is_set():
            woken.clear()
            pause_s, wakes = pace.look_s, woken
            try:
                until_s = loop.time() + pace.lease_s
                leased = await asyncio.to_thread(
                    self._outbox.lease,
                    self._owner,
                    target,
                    lease_s=pace.lease_s,
                    limit=1 if rests else pace.together,
                )
                await self._drop_arrived(self.states[target].refused)
                if loop.time() + pace.send_s > until_s:
                    leased = ()  # leasing took too long; the outbox gives them again
                if not leased:
                    await self._ping(target, sender)
                sendings = (self._send(sender, delivery, rests + 1) for delivery in leased)
                done = await asyncio.gather(*sendings, return_exceptions=True)
                for error in done:
                    if isinstance(error, BaseException):
                        raise error
                rest_s = max((wait_s for wait_s in done if isinstance(wait_s, float)), default=0.0)
                troubles = 0
                if rest_s:
                    rests, pause_s, wakes = rests + 1, rest_s, self._stopping
                elif leased:
                    rests, pause_s = 0, 0.0  # there may be more
            except Exception:  # perhaps the store does not answer; what was sent is sent again
                troubles += 1
                if troubles == 1:
                    _log.exception("the outbox cannot be used; %s waits", target)
                pause_s = min(pace.wait_s(troubles), pace.longest_rest_s)
                wakes = self._stopping
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(wakes.wait(), pause_s)

    async def _warn_of_unknown_targets(self) -> None:
        waiting = await asyncio.to_thread(self._outbox.waiting_results)
        for target in sorted(set(waiting) - set(self._senders)):
            _log.warning("results wait to be sent to %s, which is not set up here", target)

    async def _drop_arrived(self, refused: dict[int, str]) -> None:
        if refused:
            waiting = await asyncio.to_thread(self._outbox.still_waiting, tuple(refused))
            for delivery_id in refused.keys() - waiting:
                del refused[delivery_id]

    async def _ping(self, target: str, sender: Sender) -> None:
        try:
            if await sender.ping():
                self._report(target, "")
        except DeliveryError as error:
            self._report(target, str(error))

    async def _send(self, sender: Sender, delivery: Delivery, failures: int) -> float:
        target, state = delivery.target, self.states[delivery.target]
        try:
            async with asyncio.timeout(self._pace.send_s):
                await sender.send(delivery)
        except TimeoutError:
            error = DeliveryError("no answer in time", away=True)
        except DeliveryError as failed:
            error = failed
        except Exception as fault:
            _log.exception("the %s sender failed on a delivery of part %s", target, delivery.part_id)
            error = DeliveryError(f"{type(fault).__name__}: {fault}")
        else:
            self._report(target, "")
            state.refused.pop(delivery.id, None)
            await asyncio.to_thread(self._outbox.delivered, delivery.id)
            return 0.0
        self._report(target, str(error) if error.away else "")
        if not error.away:
            if not delivery.attempts:  # once, not with every attempt
                _log.warning("%s does not take the result of part %s: %s", target, delivery.part_id, error)
            if len(state.refused) < _MOST_REFUSED:
                state.refused[delivery.id] = str(error)
        wait_s = self._wait_s(error, failures if error.away else delivery.attempts + 1)
        await asyncio.to_thread(
            self._outbox.postpone, delivery.id, self._owner, error=str(error), wait_s=wait_s
        )
        return wait_s if error.away else 0.0

    def _wait_s(self, error: DeliveryError, failures: int) -> float:
        pace = self._pace
        short = error.away and not error.lasting and not error.retry_after_s
        longest_s = pace.longest_rest_s if short else pace.longest_wait_s
        wait_s = longest_s if error.lasting else min(pace.wait_s(failures), longest_s)
        # deliveries that failed together are tried again at different times
        return min(max(wait_s * self._rng.uniform(0.5, 1.0), error.retry_after_s), longest_s)

    def _report(self, target: str, error: str) -> None:
        state = self.states[target]
        if bool(error) != bool(state.error):
            state.since = datetime.now(UTC)
            if error:
                _log.warning("%s is away, its results wait: %s", target, error)
            else:
                _log.info("%s is back", target)
        state.error = error


def body_of(delivery: Delivery) -> bytes:
    """The payload and the delivery's number, as compact JSON in UTF-8."""
    content = {**delivery.payload, "delivery_id": delivery.id}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")
