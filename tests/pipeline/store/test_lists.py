"""Lists of parts: newest first, searched, paged; the queue of review; serials among those of the store."""

from __future__ import annotations

from datetime import timedelta

import pytest

from pipeline.common.part_id import new_part_id
from pipeline.common.records import PartRecord, PartState
from pipeline.common.serial_rules import ProductionOrder, SerialRules
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, correct, due, race, reading, received


def _ids(parts: tuple[PartRecord, ...]) -> list[str]:
    return [part.id for part in parts]


def test_newest_first_and_page_by_page(store: Store) -> None:
    ids = [received(store).id for _ in range(6)]
    part = received(store, PartState.REVIEW, "KX4")
    part = correct(store, part.id, "KX5")
    newest = [part.id, *ids[::-1]]
    assert _ids(store.parts()) == newest
    pages = [store.parts(limit=3)]
    while pages[-1]:
        pages.append(store.parts(limit=3, before=pages[-1][-1].id))
    assert [len(page) for page in pages] == [3, 3, 1, 0]
    assert [i for page in pages for i in _ids(page)] == newest
    assert pages[0][0] == part


@pytest.mark.parametrize(
    ("sought", "found"),
    [
        ({"text": "kx4"}, "abd"),
        ({"text": "X407"}, "a"),
        ({"text": "%"}, "c"),
        ({"text": "_"}, "c"),
        ({"text": "\\"}, "c"),
        ({"text": "'"}, ""),
        ({"text": "K.4"}, ""),
        ({"name": "GRÖSSE"}, "b"),
        ({"name": "größe"}, "b"),
        ({"name": "plate"}, "abc"),
        ({"name": "plate 1", "text": "kx4"}, "a"),
        ({"name": "Ω" * 200}, ""),
        ({"state": PartState.REVIEW}, "bd"),
        ({"state": PartState.REVIEW, "name": "plate"}, "b"),
        ({"state": PartState.TOUCH_NEEDED}, ""),
    ],
)
def test_search(store: Store, sought: dict[str, str], found: str) -> None:
    ids = {
        "a": received(store, text="KX407251", name="Plate 1"),
        "b": received(store, PartState.REVIEW, "KX4O7251", name="PLATE 2, Größe 3"),
        "c": received(store, text="100%_\\", name="plate 3"),
        "d": received(store, PartState.REVIEW, "kx4", name=""),
    }
    assert _ids(store.parts(**sought)) == [ids[k].id for k in reversed(found)]


@pytest.mark.parametrize("wrong", [{"before": "x\x00"}, {"text": "\x00"}, {"name": "\ud800"}])
def test_lists_that_cannot_be(store: Store, wrong: dict[str, object]) -> None:
    with pytest.raises(UnfitError):
        store.parts(**wrong)


def test_the_queue_is_worked_off_from_its_head(store: Store) -> None:
    first, _, second, third = (
        received(store, state, "KX4")
        for state in (PartState.REVIEW, PartState.ACCEPTED, PartState.REVIEW, PartState.REVIEW)
    )
    assert _ids(store.queue()) == [first.id, second.id, third.id]
    assert _ids(store.queue(limit=2)) == [first.id, second.id]
    assert store.next_in_queue() == first
    assert store.next_in_queue(first.id) == second
    assert store.next_in_queue(third.id) == first
    assert store.next_in_queue(new_part_id()) == first
    correct(store, second.id, "KX4")
    assert store.next_in_queue(first.id) == third
    for part in (first, third):
        correct(store, part.id, "")
    assert (store.queue(), store.next_in_queue(), store.next_in_queue(first.id)) == ((), None, None)


def test_reviewed_parts_since_a_time(store: Store, clock: Clock) -> None:
    parts = [received(store, PartState.REVIEW, "KX4") for _ in range(4)]
    # in another order than they were received
    for part in (parts[2], parts[0], parts[1]):
        clock.go_on(hours=1)
        correct(store, part.id, "KX4")
    newest = [p.id for p in parts[2::-1]]

    def since(hours: float, **page: object) -> list[str]:
        reviewed = store.parts(state=PartState.REVIEWED, **page)
        return [p.id for p in reviewed if p.review.at >= START + timedelta(hours=hours)]

    assert since(0.0) == newest
    assert since(2.0) == newest[1:]
    assert since(0.0, limit=2) == newest[:2]
    assert since(0.0, before=newest[1]) == newest[2:]
    # noted later: that is no review
    clock.go_on(hours=5)
    store.note_event(parts[2].id, "enrolled", {})
    assert since(2.0) == newest[1:]


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
