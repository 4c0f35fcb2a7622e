"""Results waiting to be published."""

from __future__ import annotations

from datetime import timedelta

from pipeline.common.record_json import from_json
from pipeline.common.records import PartRecord, PartState, ReviewAction
from pipeline.store.store import Store
from tests.support.store_samples import Clock, reading, received


def test_a_result_waits_until_it_has_arrived(store: Store, clock: Clock) -> None:
    part = received(store, targets=("mqtt",))
    (sent,) = store.due()
    assert (sent.target, sent.part_id, sent.attempts) == ("mqtt", part.id, 0)
    assert from_json(PartRecord, dict(sent.payload)) == part
    assert store.undelivered() == 1
    until = clock.at + timedelta(seconds=10)
    store.postpone(sent.id, error="no\x00 broker" * 200, until=until)
    assert store.due() == ()
    clock.at = until
    (again,) = store.due()
    assert (again.id, again.payload, again.attempts) == (sent.id, sent.payload, 1)
    store.delivered(again.id)
    assert (store.due(), store.undelivered()) == ((), 0)
    # a second dispatcher had it as well
    store.delivered(again.id)
    store.postpone(again.id, error="", until=until)
    assert store.undelivered() == 0


def test_what_happens_to_one_part_is_told_in_order(store: Store, clock: Clock) -> None:
    part = received(store, PartState.REVIEW, "KX4", targets=("mqtt", "webhook"))
    store.review(part.id, action=ReviewAction.CORRECT, text="KX5", who="Ada", targets=("mqtt",))
    other = received(store, targets=("mqtt",))
    first, to_webhook, of_other = store.due()
    assert [(d.part_id, d.target) for d in (first, to_webhook, of_other)] == [
        (part.id, "mqtt"),
        (part.id, "webhook"),
        (other.id, "mqtt"),
    ]
    # the first is not taken in: the second of that part waits, other parts and receivers do not
    store.postpone(first.id, error="away", until=clock.at + timedelta(minutes=1))
    assert [d.id for d in store.due()] == [to_webhook.id, of_other.id]
    clock.go_on(minutes=1)
    assert [d.id for d in store.due()] == [to_webhook.id, of_other.id, first.id]
    store.delivered(first.id)
    second = store.due()[0] if store.due()[0].part_id == part.id else store.due()[-1]
    assert {d.payload["state"] for d in store.due() if d.target == "mqtt" and d.part_id == part.id} == {
        "reviewed"
    }
    assert second.id > first.id


def test_what_cannot_be_sent_does_not_hold_up_what_is_new(store: Store, clock: Clock) -> None:
    for _ in range(5):
        received(store, targets=("webhook",))
    for stuck in store.due():
        store.postpone(stuck.id, error="away", until=clock.at + timedelta(seconds=5))
    new = received(store, targets=("mqtt",))
    clock.go_on(seconds=10)
    assert store.due(limit=1)[0].part_id == new.id


def test_numbers_are_not_given_twice(store: Store) -> None:
    received(store, targets=("mqtt",))
    (first,) = store.due()
    store.delivered(first.id)
    received(store, targets=("mqtt",))
    assert store.due()[0].id > first.id


def test_touch_needed_is_sent_without_a_text_and_so_is_what_came_of_it(store: Store) -> None:
    unsure = reading("KX4O", "vision")
    part = received(store, PartState.TOUCH_NEEDED, readings=(unsure,), targets=("mqtt",))
    (needed,) = store.due()
    assert (needed.payload["state"], needed.payload["text"]) == ("touch_needed", "")
    store.add_readings(
        part.id, readings=(reading("KX4", "fused"),), state=PartState.ACCEPTED, targets=("mqtt",)
    )
    store.delivered(needed.id)
    (felt,) = store.due()
    assert (felt.payload["state"], felt.payload["text"]) == ("accepted", "KX4")
