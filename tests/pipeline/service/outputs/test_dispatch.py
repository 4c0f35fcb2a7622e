"""The dispatcher: everything arrives, in order for each part, whatever fails on the way."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable
from random import Random
from typing import Any

import numpy as np
import pytest

from pipeline.common.records import Delivery
from pipeline.service.outputs.dispatch import DeliveryError, Dispatcher, Pace, body_of
from tests.support.line_fakes import LONG_S, MemoryOutbox, part, until

pytestmark = pytest.mark.anyio

FAST = Pace(look_s=0.02, first_wait_s=0.01, longest_wait_s=0.05, longest_rest_s=0.05, send_s=5.0)


class Recorder:
    """A sender that keeps what it was given; `trouble` may raise first."""

    def __init__(self, trouble: Callable[[Delivery], Awaitable[None]] | None = None) -> None:
        self.arrived: list[Delivery] = []
        self.attempts: Counter[int] = Counter()
        self.closed = False
        self._trouble = trouble

    async def ping(self) -> bool:
        return False

    async def send(self, delivery: Delivery) -> None:
        self.attempts[delivery.id] += 1
        if self._trouble is not None:
            await self._trouble(delivery)
        self.arrived.append(delivery)

    async def close(self) -> None:
        self.closed = True

    def of(self, part_id: str) -> list[int]:
        return [delivery.id for delivery in self.arrived if delivery.part_id == part_id]


def filled(parts: int, each: int, targets: Iterable[str] = ("webhook",)) -> MemoryOutbox:
    outbox = MemoryOutbox()
    for number in range(each):
        for index in range(parts):
            outbox.put(part(id=f"PART{index}", text=f"TEXT{number}"), tuple(targets))
    return outbox


async def emptied(outbox: MemoryOutbox, dispatcher: Dispatcher) -> None:
    dispatcher.start()
    await until(lambda: outbox.undelivered() == 0, why="for the outbox to be empty")
    await dispatcher.stop()


def dispatcher_of(outbox: Any, pace: Pace = FAST, **senders: Recorder) -> Dispatcher:
    return Dispatcher(outbox, senders, rng=Random(5), pace=pace)


async def test_everything_arrives_once_and_in_order_for_each_part() -> None:
    outbox, webhook, mqtt = filled(7, 5, ("webhook", "mqtt")), Recorder(), Recorder()
    dispatcher = dispatcher_of(outbox, webhook=webhook, mqtt=mqtt)
    await emptied(outbox, dispatcher)
    for sender in (webhook, mqtt):
        assert len(sender.arrived) == 35
        assert set(sender.attempts.values()) == {1}
        assert sender.closed
        for index in range(7):
            assert sender.of(f"PART{index}") == sorted(sender.of(f"PART{index}"))
    assert not outbox.failures


@pytest.mark.parametrize("away", [True, False])
async def test_what_fails_at_random_arrives_all_the_same_and_in_order(away: bool) -> None:
    rng = np.random.default_rng(3)

    async def trouble(_: Delivery) -> None:
        if rng.random() < 0.4:
            raise DeliveryError("not now", away=away)

    outbox, sender = filled(6, 6), Recorder(trouble)
    dispatcher = dispatcher_of(outbox, webhook=sender)
    await emptied(outbox, dispatcher)
    assert len(sender.arrived) == 36
    for index in range(6):
        assert sender.of(f"PART{index}") == sorted(sender.of(f"PART{index}"))
    assert sum(sender.attempts.values()) > 36
    assert not any(one.error or one.refused for one in dispatcher.states.values())


async def test_a_target_that_is_away_is_asked_seldom_and_holds_up_no_other() -> None:
    back = asyncio.Event()

    async def trouble(_: Delivery) -> None:
        if not back.is_set():
            raise DeliveryError("away", away=True)

    outbox, gone, well = filled(300, 1, ("mqtt", "webhook")), Recorder(trouble), Recorder()
    pace = Pace(look_s=0.01, first_wait_s=0.05, longest_wait_s=0.3, longest_rest_s=0.2)
    dispatcher = dispatcher_of(outbox, pace, mqtt=gone, webhook=well)
    dispatcher.start()
    await until(lambda: len(well.arrived) == 300, why="for the target that works")
    assert "away" in dispatcher.states["mqtt"].error
    assert sum(gone.attempts.values()) < 100  # of 300 that are due: one tried after every rest
    back.set()
    await until(lambda: outbox.undelivered() == 0)
    await dispatcher.stop()
    assert len(gone.arrived) == 300


async def test_a_sender_that_hangs_holds_up_no_other_and_is_given_up() -> None:
    first = True

    async def hang(_: Delivery) -> None:
        nonlocal first
        if first:
            first = False
            await asyncio.Event().wait()

    outbox, hanging, well = filled(1, 2, ("mqtt", "webhook")), Recorder(hang), Recorder()
    pace = Pace(look_s=0.02, first_wait_s=0.01, longest_wait_s=0.05, longest_rest_s=0.05, send_s=0.5)
    dispatcher = dispatcher_of(outbox, pace, mqtt=hanging, webhook=well)
    dispatcher.start()
    await until(lambda: len(well.arrived) == 2)
    assert not hanging.arrived
    await until(lambda: outbox.undelivered() == 0)
    await dispatcher.stop()
    assert any("in time" in error for _, error in outbox.failures)


async def test_a_sender_that_breaks_does_not_end_the_dispatcher() -> None:
    async def broken(delivery: Delivery) -> None:
        if delivery.attempts == 0:
            raise RuntimeError("a fault of the program")

    outbox, sender = filled(2, 2), Recorder(broken)
    await emptied(outbox, dispatcher_of(outbox, webhook=sender))
    assert any("RuntimeError" in error for _, error in outbox.failures)


async def test_a_store_that_is_away_for_a_while_costs_nothing_but_a_second_sending() -> None:
    class Failing(MemoryOutbox):
        looks = takes = 0

        def lease(self, *given: Any, **options: Any) -> tuple[Delivery, ...]:
            Failing.looks += 1
            if Failing.looks < 4:
                raise OSError("the database does not answer")
            return super().lease(*given, **options)

        def delivered(self, delivery_id: int) -> None:
            Failing.takes += 1
            if Failing.takes == 1:
                raise OSError("the database does not answer")
            super().delivered(delivery_id)

    outbox, sender = Failing(), Recorder()
    outbox.put(part(), ("webhook",))
    await emptied(outbox, dispatcher_of(outbox, webhook=sender))
    assert [delivery.id for delivery in sender.arrived] == [1, 1]


async def test_a_target_that_is_no_longer_set_up_keeps_its_deliveries_and_is_said(
    caplog: pytest.LogCaptureFixture,
) -> None:
    outbox, sender = filled(60, 1, ("mqtt", "webhook")), Recorder()
    pace = Pace(look_s=0.01, first_wait_s=0.01, longest_wait_s=60.0)
    dispatcher = dispatcher_of(outbox, pace, webhook=sender)
    dispatcher.start()
    await until(lambda: len(sender.arrived) == 60)
    await dispatcher.stop()
    assert outbox.undelivered() == 60
    assert not outbox.failures  # another service that shares the store may send them
    assert "results wait to be sent to mqtt, which is not set up here" in caplog.text


def test_waiting_grows_to_its_limit_and_is_never_all_at_once() -> None:
    pace = Pace(first_wait_s=1.0, longest_wait_s=300.0)
    assert [pace.wait_s(n) for n in (1, 2, 3, 9, 10, 1000)] == [1.0, 2.0, 4.0, 256.0, 300.0, 300.0]

    class Timed(MemoryOutbox):
        def postpone(self, *given: Any, wait_s: float, **options: Any) -> None:
            waits.append(wait_s)
            super().postpone(*given, wait_s=wait_s, **options)

    async def refuse(_: Delivery) -> None:
        raise DeliveryError("no", lasting=True)

    async def run() -> None:
        outbox = Timed()
        for index in range(40):
            outbox.put(part(id=f"PART{index}"), ("webhook",))
        dispatcher = dispatcher_of(outbox, Pace(look_s=0.01, longest_wait_s=100.0), webhook=Recorder(refuse))
        dispatcher.start()
        await until(lambda: len(waits) == 40)
        await dispatcher.stop()

    waits: list[float] = []
    asyncio.run(run())
    assert 50.0 <= min(waits) < 65.0  # a share of 0.5 to 1 of 100 s
    assert 85.0 < max(waits) <= 100.0


async def test_waking_is_quicker_than_looking() -> None:
    outbox, sender = MemoryOutbox(), Recorder()
    dispatcher = dispatcher_of(outbox, Pace(look_s=1000.0), webhook=sender)
    dispatcher.start()
    await asyncio.sleep(0.05)
    outbox.put(part(), ("webhook",))
    dispatcher.wake()
    await until(lambda: len(sender.arrived) == 1)
    await dispatcher.stop()


async def test_a_target_that_is_away_is_known_though_there_is_nothing_to_send() -> None:
    class Pinged(Recorder):
        away = ""

        async def ping(self) -> bool:
            if self.away:
                raise DeliveryError(self.away, away=True)
            return True

    sender = Pinged()
    dispatcher = dispatcher_of(MemoryOutbox(), mqtt=sender)
    dispatcher.start()
    for sender.away in ("the broker has gone", ""):
        await until(lambda: dispatcher.states["mqtt"].error == sender.away)
    await dispatcher.stop()
    assert sender.closed


async def test_stopping_lets_what_is_being_sent_arrive_and_keeps_the_rest() -> None:
    begun, go = asyncio.Event(), asyncio.Event()

    async def slow(_: Delivery) -> None:
        begun.set()
        await go.wait()

    outbox, sender = filled(1, 2), Recorder(slow)
    dispatcher = dispatcher_of(outbox, webhook=sender)
    dispatcher.start()
    await asyncio.wait_for(begun.wait(), LONG_S)
    stopping = asyncio.create_task(dispatcher.stop(grace_s=LONG_S))
    await asyncio.sleep(0.05)
    go.set()
    await asyncio.wait_for(stopping, LONG_S)
    assert [delivery.id for delivery in sender.arrived] == [1]
    assert outbox.undelivered() == 1
    assert sender.closed


async def test_a_stop_does_not_wait_for_ever_and_loses_nothing() -> None:
    async def never(_: Delivery) -> None:
        await asyncio.Event().wait()

    outbox, sender = filled(1, 1), Recorder(never)
    dispatcher = dispatcher_of(outbox, webhook=sender)
    dispatcher.start()
    await until(lambda: sender.attempts.total() == 1)
    await asyncio.wait_for(dispatcher.stop(grace_s=0.05), LONG_S)
    assert outbox.undelivered() == 1
    assert not sender.arrived


def test_the_body_is_the_part_and_the_deliverys_number() -> None:
    outbox = MemoryOutbox()
    outbox.put(part(name="Träger \ud800"), ("webhook",))
    body = body_of(outbox.lease("me", ("webhook",), lease_s=1.0)[0])
    assert '"name":"Träger ?"'.encode() in body
    assert body.endswith(b'"delivery_id":1}')
