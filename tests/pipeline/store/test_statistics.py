"""The dashboard's figures."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import timedelta

import pytest

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import PLAN, START, Clock, correct, reading, received


def timed(source: str, decision: str, seconds: float) -> ReadingRecord:
    return replace(reading("KX407251", source, decision), seconds=seconds)


def test_parts_of_every_fate_are_counted_once(store: Store, clock: Clock) -> None:
    received(store)  # before the time that is asked for
    since = clock.go_on(hours=2)
    received(store, readings=(timed("vision", "accept", 0.25),))
    clock.go_on(hours=2)
    fused = []
    for decision in ("accept", "review", "review", "reject", "reject"):
        part = received(store, PartState.TOUCH_NEEDED, readings=(timed("vision", "review", 0.5),), plan=PLAN)
        state = PartState.ACCEPTED if decision == "accept" else PartState.REVIEW
        fused.append(store.add_readings(part.id, readings=(timed("fused", decision, 1.5),), state=state).id)
    correct(store, fused[1], "ZZZ", "Bob")  # the first review does not count, the last does
    correct(store, fused[1], "KX407251")
    correct(store, fused[2], "KX40725")  # a character too many was read: 6 of 7 are right
    correct(store, fused[3], "")
    figures = store.statistics(since)
    assert (figures.parts, figures.by_camera, figures.fell_back, figures.rejects) == (6, 1, 5, 2)
    assert (figures.reviewed, figures.right_before_review, figures.awaiting) == (3, 1, 1)
    assert (figures.characters_reviewed, figures.characters_right) == (8 + 7, 8 + 6)
    assert figures.by_state == {PartState.ACCEPTED: 2, PartState.REVIEW: 1, PartState.REVIEWED: 3}
    first, between, last = figures.trend
    assert [step.at for step in figures.trend] == [
        since.replace(minute=0) + timedelta(hours=k) for k in range(3)
    ]
    assert (first.parts, first.accepted, between.parts) == (1, 1, 0)
    assert (last.parts, last.accepted, last.review, last.rejects) == (5, 1, 4, 2)
    assert figures.seconds == {"vision": (0.5, 0.5), "fused": (1.5, 1.5)}
    # other zones are the same instants
    assert store.statistics(since.astimezone()) == figures


def test_a_part_that_waits_for_touch_is_not_rejected_yet(store: Store, clock: Clock) -> None:
    since = clock.go_on(hours=1)
    unread = (timed("vision", "reject", 0.5),)
    part = received(store, PartState.TOUCH_NEEDED, readings=unread, plan=PLAN)
    assert store.statistics(since).rejects == 0
    store.add_readings(part.id, readings=(timed("fused", "reject", 1.5),), state=PartState.REVIEW)
    assert store.statistics(since).rejects == 1


@pytest.mark.parametrize("n", [1, 2, 99, 100, 101])
def test_percentiles_are_nearest_ranks(store: Store, n: int) -> None:
    readings = tuple(replace(reading("K"), seconds=float(k)) for k in range(n, 0, -1))
    received(store, readings=readings)
    assert store.statistics(START).seconds == {"vision": (math.ceil(n / 2), math.ceil(99 * n / 100))}


def test_times_that_cannot_be(store: Store) -> None:
    for wrong in (START.replace(tzinfo=None), START - timedelta(days=4000)):
        with pytest.raises(UnfitError, match="give a time"):
            store.statistics(wrong)
    # nothing has happened in time to come
    assert store.statistics(START + timedelta(days=1)).trend == ()
