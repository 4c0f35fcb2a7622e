"""Figures of the store: the dashboard, agreement in shadow mode, alerts that are raised once and cleared once."""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace
from datetime import timedelta

import pytest

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import Agreement, PartState, ShadowRecord
from pipeline.store.alerts import DRIFT, REJECT_RATE, REVIEW_RATE
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import PLAN, START, Clock, correct, due, race, reading, received


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


@pytest.mark.parametrize("n", [1, 2, 100])
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


SAME, OTHER, ALONE = Agreement.SAME, Agreement.OTHER, Agreement.ALONE


def test_agreement_is_counted_by_day(store: Store, clock: Clock) -> None:
    since = START + timedelta(days=1)
    for days, kind, would_be in (
        (0, SAME, PartState.ACCEPTED),  # too early
        (1, SAME, PartState.ACCEPTED),
        (1, SAME, PartState.REVIEW),
        (1, OTHER, PartState.ACCEPTED),
        (3, ALONE, PartState.TOUCH_NEEDED),
    ):
        clock.at = START + timedelta(days=days)
        received(store, PartState.SHADOW, shadow=ShadowRecord(kind, would_be))
        received(store)  # an ordinary part does not count
    first, last = store.agreement_by_day(since)
    assert (first.day, last.day) == (since.date(), since.date() + timedelta(days=2))
    assert (first.parts, first.compared, first.same, first.other, first.nothing) == (3, 3, 2, 1, 0)
    assert (first.accepted, first.accepted_other) == (2, 1)
    assert (last.parts, last.compared, last.accepted) == (1, 0, 0)
    with pytest.raises(UnfitError, match="time with its zone"):
        store.agreement_by_day(since.replace(tzinfo=None))


def test_what_would_have_been_decided_is_kept(store: Store) -> None:
    shadow = ShadowRecord(Agreement.OTHER, PartState.ACCEPTED)
    part = received(store, PartState.SHADOW, expected="KX407257", shadow=shadow, targets=("mqtt",))
    assert (store.part(part.id).shadow, part.state) == (shadow, PartState.SHADOW)
    assert received(store).shadow is None
    last = store.story(part.id).events[-1]
    assert (last.kind, dict(last.data)) == ("compared", {"agreement": "other", "would_be": "accepted"})
    assert store.queue() == ()
    # a person's review keeps it, and a later reading changes it
    correct(store, part.id, "KX407257")
    assert store.part(part.id).shadow == shadow
    again = received(store, PartState.SHADOW, shadow=shadow)
    better = ShadowRecord(Agreement.SAME, PartState.REVIEW)
    read = store.add_readings(
        again.id, readings=(reading(source="fused"),), state=PartState.SHADOW, shadow=better
    )
    assert read.shadow == better


WINDOW = 10
LIMITS = {REJECT_RATE: 0.35, REVIEW_RATE: 0.0}


def parts(store: Store, *, good: int = 0, rejected: int = 0) -> None:
    for _ in range(good):
        received(store)
    for _ in range(rejected):
        received(store, PartState.REVIEW, readings=(reading("KX4", "fused", "reject"),))


def look(
    store: Store, limits: dict[str, float] | None = None, drifts: dict[str, str | None] | None = None
) -> list[str]:
    """Look for alerts, and say which are raised after that."""
    store.look_for_alerts(limits=limits or LIMITS, window=WINDOW, drifts=drifts or {}, targets=("webhook",))
    return [alert.name for alert in store.alerts()]


def sent(store: Store) -> list[tuple[str, str]]:
    """What waits to be sent, in the order it arrives."""
    alerts = []
    while waiting := due(store):
        alerts += [(d.payload["alert"], d.payload["state"]) for d in waiting]
        for delivery in waiting:
            store.delivered(delivery.id)
    return alerts


def test_a_rate_is_told_once_and_cleared_once(store: Store) -> None:
    parts(store, rejected=WINDOW - 1)
    assert look(store) == []  # too few to tell
    parts(store, rejected=1)
    assert look(store) == look(store) == [REJECT_RATE]
    assert store.alerts()[0].message == "10 of the last 10 parts were rejected; the limit is 35 %"
    assert sent(store) == [(REJECT_RATE, "raised")]
    parts(store, good=7)
    assert look(store) == [REJECT_RATE]  # 3 of 10 is below the limit, and may be chance
    parts(store, good=3)
    assert look(store) == look(store) == []
    assert sent(store) == [(REJECT_RATE, "cleared")]


def test_a_restart_repeats_nothing_and_a_target_that_is_away_gets_all_in_order(blank_url: str) -> None:
    with contextlib.closing(Store.open(blank_url)) as store:
        parts(store, rejected=WINDOW)
        look(store)
    with contextlib.closing(Store.open(blank_url)) as store:
        assert look(store) == [REJECT_RATE]
        parts(store, good=WINDOW)
        look(store)
        assert sent(store) == [(REJECT_RATE, "raised"), (REJECT_RATE, "cleared")]


def test_many_who_look_at_once_raise_it_once(store: Store) -> None:
    parts(store, rejected=WINDOW)
    race(lambda _: look(store), n=8)
    assert sent(store) == [(REJECT_RATE, "raised")]


def test_the_review_rate_counts_parts_that_a_person_has_dealt_with(store: Store) -> None:
    limits = {REVIEW_RATE: 0.4, REJECT_RATE: 0.0}
    parts(store, good=5)
    for _ in range(5):
        part = received(store, PartState.REVIEW)
        correct(store, part.id, "KX407251")
    received(store, PartState.TOUCH_NEEDED)  # not decided yet
    assert look(store, limits) == [REVIEW_RATE]
    assert look(store, {REVIEW_RATE: 0.0}) == []  # nobody asks any more


def test_drift_is_not_cleared_by_a_start_that_has_read_too_few_parts_to_tell(store: Store) -> None:
    parts(store, good=1)
    assert look(store, drifts={"": "the parts are duller", "housing": None}) == [DRIFT]
    assert look(store, drifts={"": None}) == [DRIFT]
    assert look(store, drifts={"": "", "housing": "unlike"}) == [f"{DRIFT}:housing"]
    assert set(sent(store)) == {(DRIFT, "raised"), (f"{DRIFT}:housing", "raised"), (DRIFT, "cleared")}
