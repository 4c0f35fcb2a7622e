"""Parts that wait for touch: felt, tried again, found after a kill, given up; none waits for ever."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.records import PartRecord, PartState, TouchWait
from pipeline.service.stage.work import TouchCall
from pipeline.service.tasks import repeat
from pipeline.service.touch_queue import NOBODY, TouchQueue
from pipeline.service.web.problem import Problem
from pipeline.store.parts import Waiting
from pipeline.store.store import Store
from tests.support.store_samples import PLAN, due, reading, received
from whisker_array.scan.stage_error import StageError

LONG_S = 600.0


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(f"sqlite:///{tmp_path}/store.db")


def waiting(store: Store, *, by_stage: bool = True, wait_s: float = LONG_S, line: str = "") -> PartRecord:
    """A part that waits for touch."""
    touch = TouchWait(by_stage, datetime.now(UTC) + timedelta(seconds=wait_s))
    unsure = (reading("KX4O", "vision", "review"),)
    return received(store, PartState.TOUCH_NEEDED, readings=unsure, plan=PLAN, touch=touch, line=line)


class Bench:
    """A queue whose stage does as it is told."""

    def __init__(self, store: Store, **settings: Any) -> None:
        self.store = store
        self.asked: list[str] = []
        self.fails: Callable[[], Exception | None] = lambda: None
        self.queue = TouchQueue(store, self.feel, give_up=self.give_up, **settings)

    async def feel(self, part: PartRecord, _call: TouchCall) -> PartRecord:
        self.asked.append(part.id)
        await asyncio.sleep(0.01)
        error = self.fails()
        if error is not None:
            raise error
        felt = (reading("KX4", "fused"),)
        return await asyncio.to_thread(
            self.store.add_readings, part.id, readings=felt, state=PartState.ACCEPTED
        )

    async def give_up(self, part: PartRecord, why: str) -> None:
        await asyncio.to_thread(self.store.give_up_touch, part.id, why=why, targets=("mqtt",))

    async def until(self, done: Callable[[], bool]) -> None:
        """Let the queue run until something is so."""
        running = asyncio.create_task(repeat("look", self.queue.look, every_s=0.01))
        until = time.monotonic() + 20.0
        while not await asyncio.to_thread(done) and time.monotonic() < until:
            await asyncio.sleep(0.01)
        running.cancel()
        await self.queue.stop()
        assert done()


def test_what_a_kill_has_left_waiting_is_felt_only_if_the_driver_knows_that_it_lies_there(
    store: Store,
) -> None:
    part, others = waiting(store), waiting(store, by_stage=False)
    bench = Bench(store, knows_place=True)
    asyncio.run(bench.until(lambda: store.part(part.id).state is PartState.ACCEPTED))
    assert bench.asked == [part.id]
    assert store.part(part.id).text == "KX4"
    # who waits for a scan of the sender's is not felt by the stage
    assert store.part(others.id).state is PartState.TOUCH_NEEDED


@pytest.mark.parametrize("error", [StageError("no air"), Problem(503, "busy"), RuntimeError("fault")])
def test_a_stage_that_fails_in_the_call_sends_the_part_to_a_person_and_a_release_feels_it(
    store: Store, error: Exception
) -> None:
    part, bench = waiting(store), Bench(store)
    bench.fails = lambda: error if len(bench.asked) == 1 else None

    async def call() -> PartRecord:
        with pytest.raises(type(error)):
            await bench.queue.attempt(part)
        await bench.queue.look()
        given_up = store.part(part.id)
        assert given_up.state is PartState.REVIEW
        assert given_up.not_felt == f"the stage has not felt it: {error}"
        return await bench.queue.attempt(given_up)

    assert asyncio.run(call()).state is PartState.ACCEPTED
    assert bench.asked == [part.id] * 2


def test_why_a_part_is_not_felt_is_noted_once_and_again_if_it_changes(store: Store) -> None:
    part, bench = waiting(store), Bench(store, knows_place=True, retry_s=0.01)
    assert bench.queue.trouble == ""
    whys = ["no part", "no part", "no part", "no air"]
    bench.fails = lambda: StageError(whys[len(bench.asked) - 1]) if len(bench.asked) <= len(whys) else None
    asyncio.run(bench.until(lambda: store.part(part.id).state is PartState.ACCEPTED))
    events = [event.data["why"] for event in store.story(part.id).events if event.kind == "touch_failed"]
    assert events == ["no part", "no air"]


def test_a_failure_is_forgotten_once_another_service_has_felt_the_part(store: Store) -> None:
    part, other = waiting(store), waiting(store)
    bench = Bench(store, knows_place=True, retry_s=LONG_S)
    bench.fails = lambda: StageError("no air")
    asyncio.run(bench.until(lambda: len(bench.queue._failures) == 2))
    assert bench.queue.trouble.startswith("2 parts wait for the stage")
    store.add_readings(part.id, readings=(reading("KX4", "fused"),), state=PartState.ACCEPTED)
    asyncio.run(bench.queue.look())
    assert bench.queue.trouble.startswith("1 part waits for the stage")
    assert bench.queue._failures.keys() == {other.id}


def test_who_asks_while_the_stage_is_at_the_part_gets_what_comes_of_it(store: Store) -> None:
    part, bench = waiting(store), Bench(store)

    async def both() -> list[PartRecord]:
        first = asyncio.create_task(bench.queue.attempt(part))
        second = asyncio.create_task(bench.queue.attempt(part))
        third = asyncio.create_task(bench.queue.attempt(part))
        await asyncio.sleep(0)
        third.cancel()  # a caller who goes away takes nothing with him
        return list(await asyncio.gather(first, second))

    felt = asyncio.run(both())
    assert felt[0] == felt[1] == store.part(part.id)
    assert bench.asked == [part.id]


def test_a_part_felt_while_the_store_is_asked_is_not_felt_again(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, bench = waiting(store), Bench(store)
    ended, ask = threading.Event(), store.waiting_for_touch

    def answer_late() -> tuple[Waiting, ...]:
        found = ask()
        assert ended.wait(20.0)
        return found

    monkeypatch.setattr(store, "waiting_for_touch", answer_late)

    async def both() -> None:
        attempt = asyncio.create_task(bench.queue.attempt(part))
        attempt.add_done_callback(lambda _: ended.set())
        await asyncio.sleep(0)
        await bench.queue.look()
        await asyncio.sleep(0)

    asyncio.run(both())
    assert bench.asked == [part.id]


@pytest.mark.parametrize("by_stage", [True, False])
def test_a_part_that_nobody_feels_goes_to_a_person_with_its_plan(store: Store, by_stage: bool) -> None:
    part = waiting(store, by_stage=by_stage, wait_s=0.0)
    bench = Bench(store, retry_s=0.01)
    bench.fails = lambda: Problem(503, "down")
    asyncio.run(bench.until(lambda: store.part(part.id).state is PartState.REVIEW))
    given_up = store.part(part.id)
    assert (given_up.text, given_up.plan, given_up.touch) == ("KX4O", PLAN, None)
    last = store.story(part.id).events[-1]
    assert (last.kind, last.data) == ("not_felt", {"why": NOBODY})
    assert [d.payload["state"] for d in due(store)] == ["review"]
    assert [p.id for p in store.queue()] == [part.id]
    # a scan that comes after all is read, and counts as felt
    store.add_readings(part.id, readings=(reading("KX4", "fused"),), state=PartState.ACCEPTED)
    assert store.part(part.id).plan is None
    assert store.statistics(datetime.now(UTC) - timedelta(hours=1)).fell_back == 1


def test_parts_from_before_there_was_a_time_are_given_up_by_their_age(store: Store) -> None:
    old = received(store, PartState.TOUCH_NEEDED, plan=PLAN)
    asyncio.run(Bench(store).queue.look())
    assert store.part(old.id).state is PartState.TOUCH_NEEDED
    time.sleep(0.02)
    asyncio.run(Bench(store, wait_s=0.01).queue.look())
    assert store.part(old.id).state is PartState.REVIEW


@pytest.mark.parametrize("leap_days", [-3650, 3650])
def test_a_clock_that_leaps_neither_ends_nor_prolongs_the_wait(
    store: Store, monkeypatch: pytest.MonkeyPatch, leap_days: int
) -> None:
    part, short = waiting(store, wait_s=LONG_S, by_stage=False), waiting(store, wait_s=0.2, by_stage=False)
    bench = Bench(store)

    class Leapt(datetime):
        @classmethod
        def now(cls, tz: object = None) -> datetime:
            return datetime.now(UTC) + timedelta(days=leap_days)

    asyncio.run(bench.queue.look())
    assert store.part(short.id).state is PartState.TOUCH_NEEDED
    monkeypatch.setattr("pipeline.service.touch_queue.datetime", Leapt)
    asyncio.run(bench.until(lambda: store.part(short.id).state is PartState.REVIEW))
    assert store.part(part.id).state is PartState.TOUCH_NEEDED
    # a service that is started only now knows no better, but waits no longer than was asked for
    late = waiting(store, wait_s=0.2, by_stage=False)
    asyncio.run(Bench(store).until(lambda: store.part(late.id).state is PartState.REVIEW))


def test_a_stage_feels_the_parts_of_its_own_line(store: Store) -> None:
    here, there = waiting(store, line="press"), waiting(store, line="paint")
    bench = Bench(store, line="press", knows_place=True)
    asyncio.run(bench.until(lambda: store.part(here.id).state is PartState.ACCEPTED))
    assert bench.asked == [here.id]
    assert (store.part(there.id).line, store.part(there.id).state) == ("paint", PartState.TOUCH_NEEDED)


def test_a_store_that_is_away_for_a_while_ends_nothing(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipeline.store.errors import StoreError

    part, bench, looked = waiting(store), Bench(store, knows_place=True), []
    found = store.waiting_for_touch

    def away(**options: datetime) -> tuple[PartRecord, ...]:
        looked.append(1)
        if len(looked) < 3:
            raise StoreError("away")
        return found(**options)

    monkeypatch.setattr(store, "waiting_for_touch", away)
    asyncio.run(bench.until(lambda: store.part(part.id).state is PartState.ACCEPTED))
    assert len(looked) >= 3
    assert store.part(part.id).state is PartState.ACCEPTED
