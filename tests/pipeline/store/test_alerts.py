"""Alerts are raised once and cleared once, also across restarts and with two services on one store."""

from __future__ import annotations

import contextlib

from pipeline.common.records import PartState
from pipeline.store.alerts import DRIFT, REJECT_RATE, REVIEW_RATE
from pipeline.store.store import Store
from tests.support.store_samples import correct, due, race, reading, received

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
