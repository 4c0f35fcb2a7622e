"""The dispatcher: everything arrives, in order for each part, whatever fails on the way."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from random import Random
from typing import Any

import numpy as np
import pytest

from pipeline.common.reading_records import to_json
from pipeline.common.records import Delivery
from pipeline.service.outputs.dispatch import DeliveryError, Dispatcher, Pace, body_of
from tests.support.line_fakes import LONG_S, Outbox, part, until

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

    def of(self, number: int) -> list[int]:
        return [delivery.id for delivery in self.arrived if int(delivery.part_id) == number]


async def emptied(outbox: Outbox, dispatcher: Dispatcher) -> None:
    dispatcher.start()
    await until(lambda: outbox.undelivered() == 0, why="for the outbox to be empty")
    await dispatcher.stop()


def dispatcher_of(outbox: Outbox, pace: Pace = FAST, **senders: Recorder) -> Dispatcher:
    return Dispatcher(outbox, senders, rng=Random(5), pace=pace)


async def test_everything_arrives_once_and_in_order_for_each_part(outbox: Outbox) -> None:
    outbox.fill(4, 4, "webhook", "mqtt")
    webhook, mqtt = Recorder(), Recorder()
    dispatcher = dispatcher_of(outbox, webhook=webhook, mqtt=mqtt)
    await emptied(outbox, dispatcher)
    for sender in (webhook, mqtt):
        assert len(sender.arrived) == 16
        assert set(sender.attempts.values()) == {1}
        assert sender.closed
        for index in range(4):
            assert sender.of(index) == sorted(sender.of(index))
    assert not outbox.postponed


@pytest.mark.parametrize("away", [True, False])
async def test_what_fails_at_random_arrives_all_the_same_and_in_order(outbox: Outbox, away: bool) -> None:
    rng = np.random.default_rng(3)

    async def trouble(_: Delivery) -> None:
        if rng.random() < 0.4:
            raise DeliveryError("not now", away=away)

    outbox.fill(4, 5, "webhook")
    sender = Recorder(trouble)
    dispatcher = dispatcher_of(outbox, webhook=sender)
    await emptied(outbox, dispatcher)
    assert len(sender.arrived) == 20
    for index in range(4):
        assert sender.of(index) == sorted(sender.of(index))
    assert sum(sender.attempts.values()) > 20
    assert not any(one.error or one.refused for one in dispatcher.states.values())


async def test_a_target_that_is_away_is_asked_seldom_and_holds_up_no_other(outbox: Outbox) -> None:
    back = asyncio.Event()

    async def trouble(_: Delivery) -> None:
        if not back.is_set():
            raise DeliveryError("away", away=True)

    outbox.fill(60, 1, "mqtt", "webhook")
    gone, well = Recorder(trouble), Recorder()
    pace = Pace(look_s=0.01, first_wait_s=0.05, longest_wait_s=0.3, longest_rest_s=0.2)
    dispatcher = dispatcher_of(outbox, pace, mqtt=gone, webhook=well)
    dispatcher.start()
    await until(lambda: len(well.arrived) == 60, why="for the target that works")
    assert "away" in dispatcher.states["mqtt"].error
    assert sum(gone.attempts.values()) < 20  # of 60 that are due: one tried after every rest
    back.set()
    await until(lambda: outbox.undelivered() == 0)
    await dispatcher.stop()
    assert len(gone.arrived) == 60


async def test_a_sender_that_hangs_holds_up_no_other_and_is_given_up(outbox: Outbox) -> None:
    first = True

    async def hang(_: Delivery) -> None:
        nonlocal first
        if first:
            first = False
            await asyncio.Event().wait()

    outbox.fill(1, 2, "mqtt", "webhook")
    hanging, well = Recorder(hang), Recorder()
    pace = Pace(look_s=0.02, first_wait_s=0.01, longest_wait_s=0.05, longest_rest_s=0.05, send_s=0.5)
    dispatcher = dispatcher_of(outbox, pace, mqtt=hanging, webhook=well)
    dispatcher.start()
    await until(lambda: len(well.arrived) == 2)
    assert not hanging.arrived
    await until(lambda: outbox.undelivered() == 0)
    await dispatcher.stop()
    assert any("in time" in error for error, _ in outbox.postponed)


async def test_a_sender_that_breaks_does_not_end_the_dispatcher(outbox: Outbox) -> None:
    async def broken(delivery: Delivery) -> None:
        if delivery.attempts == 0:
            raise RuntimeError("a fault of the program")

    outbox.fill(2, 2, "webhook")
    sender = Recorder(broken)
    await emptied(outbox, dispatcher_of(outbox, webhook=sender))
    assert any("RuntimeError" in error for error, _ in outbox.postponed)


def fails_first(call: Callable[..., Any], times: int) -> Callable[..., Any]:
    """The same call, which fails so many times before."""
    fails = iter(range(times))

    def made(*given: Any, **options: Any) -> Any:
        if next(fails, None) is not None:
            raise OSError("the database does not answer")
        return call(*given, **options)

    return made


async def test_a_store_that_is_away_for_a_while_costs_nothing_but_a_second_sending(
    outbox: Outbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, times in (("lease", 3), ("delivered", 1)):
        monkeypatch.setattr(outbox, name, fails_first(getattr(outbox, name), times))
    sender = Recorder()
    outbox.fill(1, 1, "webhook")
    await emptied(outbox, dispatcher_of(outbox, webhook=sender))
    assert [delivery.id for delivery in sender.arrived] == [1, 1]


async def test_a_target_that_is_no_longer_set_up_keeps_its_deliveries_and_is_said(
    outbox: Outbox, caplog: pytest.LogCaptureFixture
) -> None:
    outbox.fill(20, 1, "mqtt", "webhook")
    sender = Recorder()
    pace = Pace(look_s=0.01, first_wait_s=0.01, longest_wait_s=60.0)
    dispatcher = dispatcher_of(outbox, pace, webhook=sender)
    dispatcher.start()
    await until(lambda: len(sender.arrived) == 20)
    await dispatcher.stop()
    assert outbox.undelivered() == 20
    assert not outbox.postponed  # another service that shares the store may send them
    assert "results wait to be sent to mqtt, which is not set up here" in caplog.text


async def test_a_refused_result_that_another_service_delivers_is_no_longer_counted(outbox: Outbox) -> None:
    async def refuse(_: Delivery) -> None:
        raise DeliveryError("no such field", lasting=True)

    outbox.fill(2, 1, "webhook")
    pace = Pace(look_s=0.01, longest_wait_s=100.0)
    here = dispatcher_of(outbox, pace, webhook=Recorder(refuse))
    here.start()
    await until(lambda: here.states["webhook"].state == "refuses 2 results")
    first = min(here.states["webhook"].refused)
    await asyncio.to_thread(outbox.delivered, first)  # as another service does that shares the store
    await until(lambda: here.states["webhook"].state == "refuses 1 result")
    assert first not in here.states["webhook"].refused
    await here.stop()


async def test_waiting_grows_to_its_limit_and_is_never_all_at_once(outbox: Outbox) -> None:
    pace = Pace(first_wait_s=1.0, longest_wait_s=300.0)
    assert [pace.wait_s(n) for n in (1, 2, 3, 9, 10, 1000)] == [1.0, 2.0, 4.0, 256.0, 300.0, 300.0]

    async def refuse(_: Delivery) -> None:
        raise DeliveryError("no", lasting=True)

    outbox.fill(40, 1, "webhook")
    dispatcher = dispatcher_of(outbox, Pace(look_s=0.01, longest_wait_s=100.0), webhook=Recorder(refuse))
    dispatcher.start()
    await until(lambda: len(outbox.postponed) == 40)
    await dispatcher.stop()
    waits = [wait_s for _, wait_s in outbox.postponed]
    assert 50.0 <= min(waits) < 65.0  # a share of 0.5 to 1 of 100 s
    assert 85.0 < max(waits) <= 100.0


async def test_a_target_that_is_away_is_known_though_there_is_nothing_to_send(outbox: Outbox) -> None:
    class Pinged(Recorder):
        away = ""

        async def ping(self) -> bool:
            if self.away:
                raise DeliveryError(self.away, away=True)
            return True

    sender = Pinged()
    dispatcher = dispatcher_of(outbox, mqtt=sender)
    dispatcher.start()
    for sender.away in ("the broker has gone", ""):
        await until(lambda: dispatcher.states["mqtt"].error == sender.away)
    await dispatcher.stop()
    assert sender.closed


async def test_stopping_lets_what_is_being_sent_arrive_and_keeps_the_rest(outbox: Outbox) -> None:
    begun, go = asyncio.Event(), asyncio.Event()

    async def slow(_: Delivery) -> None:
        begun.set()
        await go.wait()

    outbox.fill(1, 2, "webhook")
    sender = Recorder(slow)
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


async def test_a_stop_does_not_wait_for_ever_and_loses_nothing(outbox: Outbox) -> None:
    async def never(_: Delivery) -> None:
        await asyncio.Event().wait()

    outbox.fill(1, 1, "webhook")
    sender = Recorder(never)
    dispatcher = dispatcher_of(outbox, webhook=sender)
    dispatcher.start()
    await until(lambda: sender.attempts.total() == 1)
    await asyncio.wait_for(dispatcher.stop(grace_s=0.05), LONG_S)
    assert outbox.undelivered() == 1
    assert not sender.arrived


def test_the_body_is_the_part_and_the_deliverys_number() -> None:
    body = body_of(Delivery(1, "webhook", "PART1", to_json(part(name="Träger \ud800"))))
    assert '"name":"Träger ?"'.encode() in body
    assert body.endswith(b'"delivery_id":1}')
