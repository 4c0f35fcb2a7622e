"""Results waiting to be published."""

from __future__ import annotations

import pytest

from pipeline.common.reading_records import from_json
from pipeline.common.records import PartRecord, PartState
from pipeline.store.store import Store
from tests.support.store_samples import Clock, correct, due, race, received


def test_a_result_waits_until_it_has_arrived(store: Store, clock: Clock) -> None:
    part = received(store, targets=("mqtt",))
    (sent,) = due(store)
    assert (sent.target, sent.part_id, sent.attempts) == ("mqtt", part.id, 0)
    assert from_json(PartRecord, dict(sent.payload)) == part
    assert store.undelivered() == 1
    store.postpone(sent.id, "tests", error="no\x00 broker" * 200, wait_s=10.0)
    assert due(store) == ()
    clock.go_on(seconds=10)
    (again,) = due(store)
    assert (again.id, again.payload, again.attempts) == (sent.id, sent.payload, 1)
    assert store.still_waiting([again.id, again.id + 1]) == {again.id}
    store.delivered(again.id)
    assert (due(store), store.undelivered(), store.still_waiting([again.id])) == ((), 0, frozenset())
    # a second dispatcher had it as well
    store.delivered(again.id)
    store.postpone(again.id, "tests", error="", wait_s=10.0)
    assert store.undelivered() == 0
    received(store, targets=("mqtt",))
    assert due(store)[0].id > again.id, "a number is not given twice"


def test_what_happens_to_one_part_is_told_in_order(store: Store, clock: Clock) -> None:
    part = received(store, PartState.REVIEW, "KX4", targets=("mqtt", "webhook"))
    correct(store, part.id, "KX5", targets=("mqtt",))
    other = received(store, targets=("mqtt",))
    first, to_webhook, of_other = due(store)
    told = [(d.part_id, d.target) for d in (first, to_webhook, of_other)]
    assert told == [(part.id, "mqtt"), (part.id, "webhook"), (other.id, "mqtt")]
    # the first is not taken in: the second of that part waits, other parts and receivers do not
    store.postpone(first.id, "tests", error="away", wait_s=60.0)
    assert [d.id for d in due(store)] == [to_webhook.id, of_other.id]
    clock.go_on(minutes=1)
    assert [d.id for d in due(store)] == [first.id, to_webhook.id, of_other.id]
    store.delivered(first.id)
    (second,) = [d for d in due(store) if d.target == "mqtt" and d.part_id == part.id]
    assert (second.payload["state"], second.id > first.id) == ("reviewed", True)


def test_what_cannot_be_sent_does_not_hold_up_what_is_new(store: Store, clock: Clock) -> None:
    for _ in range(5):
        received(store, targets=("webhook",))
    for stuck in due(store):
        store.postpone(stuck.id, "tests", error="away", wait_s=5.0)
    new = received(store, targets=("webhook",))
    clock.go_on(seconds=10)
    assert [d.part_id for d in due(store, limit=1)] == [new.id]
    assert len(due(store)) == 6


@pytest.mark.parametrize("back_s", [1.0, 200.0, 3600.0, 86_400.0])
def test_a_clock_that_is_set_back_holds_up_no_delivery(store: Store, clock: Clock, back_s: float) -> None:
    tried = received(store, targets=("mqtt",))
    store.postpone(due(store)[0].id, "tests", error="away", wait_s=1e9)
    new = received(store, targets=("mqtt",))
    clock.go_on(seconds=-back_s)
    at_once = {d.part_id for d in due(store)}
    assert new.id in at_once, "never tried: due whatever the time is"
    clock.go_on(seconds=300.0)
    # the longest wait by any clock: what is put off for longer is due at once
    assert tried.id in at_once | {d.part_id for d in due(store)}


def test_what_one_has_leased_the_others_leave_alone_until_the_lease_is_over(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4", targets=("mqtt",))
    correct(store, part.id, "KX5", targets=("mqtt",))
    (first,) = store.lease("one", "mqtt", lease_s=60.0)
    assert store.lease("one", "mqtt", lease_s=60.0) == (first,), "what is its own it is given again"
    assert store.lease("other", "mqtt", lease_s=60.0) == (), "nor is the second sent before the first"
    store.release("other")
    store.postpone(first.id, "other", error="not its to put off", wait_s=0.0)
    assert store.lease("other", "mqtt", lease_s=60.0) == ()
    store.release("one")
    assert store.lease("other", "mqtt", lease_s=0.0) == (first,)
    assert store.lease("third", "mqtt", lease_s=60.0) == (first,), "that lease was over as it was given"
    store.delivered(first.id)
    (second,) = store.lease("other", "mqtt", lease_s=60.0)
    assert second.id > first.id


def test_a_lease_given_before_the_clock_was_set_back_ends(store: Store, clock: Clock) -> None:
    """By PostgreSQL the leases go by the server's clock, which no test sets."""
    with store.read_transaction() as tx:
        if tx.postgresql:
            return
    received(store, targets=("mqtt",))
    store.lease("dead", "mqtt", lease_s=60.0)
    clock.go_on(days=-1)
    assert len(store.lease("other", "mqtt", lease_s=60.0)) == 1


def test_a_target_that_one_cannot_send_to_is_left_to_others(store: Store) -> None:
    received(store, targets=("mqtt",))
    assert store.lease("one", "webhook", lease_s=60.0) == ()
    assert {target: results.n for target, results in store.waiting_results().items()} == {"mqtt": 1}
    assert len(store.lease("other", "mqtt", lease_s=60.0)) == 1


def test_of_many_that_lease_at_once_each_has_its_own(store: Store) -> None:
    for _ in range(20):
        received(store, targets=("mqtt",))
    deliveries = race(lambda k: store.lease(f"owner {k}", "mqtt", lease_s=60.0, limit=3), n=6)
    leased = [delivery.id for taken in deliveries for delivery in taken]
    assert len(leased) == len(set(leased))
    assert len(leased) >= 3, "one at least has what it asked for"
