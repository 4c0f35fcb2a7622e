"""Serials among those of the store."""

from __future__ import annotations

from pipeline.common.records import PartState
from pipeline.common.serial_rules import ProductionOrder, SerialRules
from pipeline.store.store import Store
from tests.support.store_samples import correct, due, race, reading, received

RULES = SerialRules(duplicates=True)


def kinds(store: Store, part_id: str) -> list[str]:
    return [event.kind for event in store.story(part_id).events]


def test_a_serial_that_another_part_bears_goes_to_a_person(store: Store) -> None:
    first = received(store, text="KX407251", name="part 1", rules=RULES)
    again = received(store, text="KX407251", name="part 2", rules=RULES, targets=("mqtt",))
    other = received(store, text="KX407252", name="part 3", rules=RULES)
    assert [p.state.value for p in (first, again, other)] == ["accepted", "review", "accepted"]
    assert again.reading is not None
    assert again.reading.messages[-1] == "KX407251 was already read on part 1"
    assert again.reading.decision == "accept"
    assert kinds(store, again.id)[-1] == "serial_alarm"
    # either may be the wrong one: the first one's history says so, and it stands
    assert kinds(store, first.id)[-1] == "serial_again"
    assert store.part(first.id).state is PartState.ACCEPTED
    assert [d.payload["state"] for d in due(store)] == ["review"]
    # a reading that comes later is asked the same
    waits = received(store, PartState.TOUCH_NEEDED, "KX4", name="part 4", rules=RULES)
    felt = (reading("KX407251", "fused"),)
    later = store.add_readings(waits.id, readings=felt, state=PartState.ACCEPTED, rules=RULES)
    assert later.state is PartState.REVIEW


def test_what_was_put_right_counts_as_it_is_and_the_same_part_is_no_second_one(store: Store) -> None:
    first = received(store, text="KX407251", name="part 1", rules=RULES)
    assert received(store, text="KX407251", name="part 1", rules=RULES).state is PartState.ACCEPTED
    correct(store, first.id, "KX407299")
    assert received(store, text="KX407299", name="part 9", rules=RULES).state is PartState.REVIEW
    unsure = received(store, PartState.REVIEW, "KX5", name="unsure", rules=RULES)
    assert received(store, text="KX5", name="sure", rules=RULES).state is PartState.ACCEPTED
    assert kinds(store, unsure.id)[-1] == "read"
    # nothing is asked unless the settings ask
    assert received(store, text="KX407299", name="part 10").state is PartState.ACCEPTED


def test_a_part_of_another_order_or_out_of_the_row_goes_to_a_person(store: Store) -> None:
    ordered = SerialRules(order=ProductionOrder("lot-7.csv", frozenset({"KX1", "KX2"})))
    assert received(store, text="KX1", rules=ordered).state is PartState.ACCEPTED
    assert received(store, text="KX7", rules=ordered).state is PartState.REVIEW
    row, states = SerialRules(jump=5), []
    for k in range(20):
        text = "AB000999" if k == 12 else f"AB{100 + k:06d}"
        states.append(received(store, text=text, name=f"r{k}", rules=row, line="press").state)
    assert [k for k, state in enumerate(states) if state is PartState.REVIEW] == [12]


def test_of_many_at_once_one_is_first(store: Store) -> None:
    came = race(lambda k: received(store, text="KX407251", name=f"part {k}", rules=RULES).state)
    assert sorted(came) == [PartState.ACCEPTED, *[PartState.REVIEW] * (len(came) - 1)]
