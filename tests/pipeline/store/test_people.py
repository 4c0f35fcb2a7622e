"""People at the store: claims, second readers who do not see what was read, audits of accepted parts."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest

from pipeline.common.people_records import Person
from pipeline.common.records import PartState, ReviewAction
from pipeline.common.shares import share
from pipeline.store.errors import ClaimedError, ConflictError, NotFoundError
from pipeline.store.review import CLAIM_S
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, reading, received

ADA, GRACE, MARY = (Person(name, token=name) for name in ("Ada", "Grace", "Mary"))
EVE, EVE_ELSEWHERE = Person("Eve", seat="one"), Person("Eve", seat="two")


def said(store: Store, part_id: str, person: Person, text: str, *, readers: int = 2) -> PartState:
    """A person says what stands there."""
    action = ReviewAction.CORRECT if text else ReviewAction.UNREADABLE
    part = store.review(
        part_id,
        action=action,
        text=text,
        who=person.name,
        token=person.token,
        seat=person.seat,
        readers=readers,
    )
    return part.state


# ---- claims


def test_a_claimed_part_is_one_persons_until_its_time_is_up(store: Store, clock: Clock) -> None:
    first, second = (received(store, PartState.REVIEW) for _ in range(2))
    claim = store.claim_part(first.id, ADA)
    assert (claim.who, claim.until) == ("Ada", START + timedelta(seconds=CLAIM_S))
    assert store.claim_part(first.id, GRACE) == claim
    assert store.claimed() == {first.id: claim}
    assert store.next_in_queue(person=GRACE) == second
    assert store.next_in_queue(person=ADA) == first
    with pytest.raises(ClaimedError, match="Ada is at part"):
        said(store, first.id, GRACE, "KX1", readers=1)
    assert store.reviews(first.id) == ()
    clock.go_on(seconds=CLAIM_S - 1.0)
    renewed = store.claim_part(first.id, ADA)
    clock.go_on(seconds=2.0)
    assert store.claim_part(first.id, GRACE) == renewed
    clock.go_on(seconds=CLAIM_S)
    assert store.claimed() == {}
    assert store.claim_part(first.id, GRACE).who == "Grace"


def test_a_claim_of_a_clock_that_was_set_back_since_holds_nobody_up(store: Store, clock: Clock) -> None:
    part = received(store, PartState.REVIEW)
    store.claim_part(part.id, ADA)
    clock.go_on(days=-1.0)
    assert store.claimed() == {}
    assert store.claim_part(part.id, GRACE).who == "Grace"
    assert said(store, part.id, GRACE, "KX1", readers=1) is PartState.REVIEWED


def test_a_claim_ends_with_the_review_or_when_it_is_let_go(store: Store) -> None:
    first, second = (received(store, PartState.REVIEW) for _ in range(2))
    for part in (first, second):
        store.claim_part(part.id, ADA)
    said(store, first.id, ADA, "KX1", readers=1)
    store.release_part(second.id, GRACE)
    assert set(store.claimed()) == {second.id}
    store.release_part(second.id, ADA)
    assert store.claimed() == {}
    with pytest.raises(NotFoundError):
        store.claim_part("0" * 26, ADA)


def test_people_without_tokens_are_told_apart_by_their_browsers(store: Store) -> None:
    part = received(store, PartState.REVIEW)
    store.claim_part(part.id, EVE)
    assert store.next_in_queue(person=EVE_ELSEWHERE) is None
    # one who calls the interface without a token sits nowhere, and is let through
    assert said(store, part.id, Person("Bob"), "KX1", readers=1) is PartState.REVIEWED


def test_of_many_who_ask_at_once_one_has_the_part(store: Store) -> None:
    part = received(store, PartState.REVIEW)
    people = [Person(f"P{k}", seat=str(k)) for k in range(8)]
    with ThreadPoolExecutor(8) as pool:
        claims = list(pool.map(lambda p: store.claim_part(part.id, p), people))
    assert len({c.who for c in claims}) == 1


# ---- two who agree


def test_a_part_is_reviewed_when_two_people_say_the_same(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    assert said(store, part.id, ADA, "KX1") is PartState.REVIEW
    assert store.part(part.id).text == "KX4"
    assert store.undelivered() == 0
    assert said(store, part.id, ADA, "KX1") is PartState.REVIEW  # nobody agrees with herself
    assert store.next_in_queue(person=ADA) is None
    assert store.next_in_queue(person=GRACE) == store.part(part.id)
    assert store.half_reviewed() == {part.id: 1}
    assert said(store, part.id, GRACE, "KX7") is PartState.REVIEW
    assert [o.after for o in store.opinions(part.id)] == ["KX1", "KX7"]
    assert said(store, part.id, MARY, "KX1") is PartState.REVIEWED
    assert store.part(part.id).text == "KX1"
    assert len(store.reviews(part.id)) == 4
    assert store.opinions(part.id) == ()
    assert not any("KX1" in str(e.data) for e in store.history(part.id) if e.kind == "read_by_person")


def test_two_who_cannot_read_it_agree_too_and_a_correction_needs_two_again(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    said(store, part.id, ADA, "")
    assert said(store, part.id, GRACE, "") is PartState.REVIEWED
    assert said(store, part.id, ADA, "KX1") is PartState.REVIEW
    assert said(store, part.id, MARY, "KX1") is PartState.REVIEWED
    assert said(store, part.id, GRACE, "KX1") is PartState.REVIEWED  # as it stands


# ---- audits


def audited(store: Store, text: str = "KX4", *, audit: bool = True, **more: object) -> str:
    """An accepted part that was drawn."""
    return received(store, PartState.ACCEPTED, text, audit=audit, **more).id


def test_a_drawn_part_is_read_once_and_stays_accepted_where_it_is_the_same(store: Store) -> None:
    audited(store, audit=False)
    received(store, PartState.REVIEW, audit=True)  # not accepted: nothing to audit
    part_id = audited(store)
    assert [p.id for p in store.queue(audits=True)] == [part_id]
    store.claim_part(part_id, GRACE)
    assert store.next_in_queue(person=ADA, audits=True) is None
    with pytest.raises(ClaimedError):
        store.review(part_id, action=ReviewAction.CORRECT, text="KX4", who="Ada", token="Ada", audit=True)
    store.review(part_id, action=ReviewAction.CORRECT, text="KX4", who="Grace", token="Grace", audit=True)
    found = store.audit(part_id)
    assert found is not None
    assert (found.after, found.before, found.who) == ("KX4", "KX4", "Grace")
    assert store.part(part_id).state is PartState.ACCEPTED
    assert (store.queue(audits=True), store.undelivered(), store.claimed()) == ((), 0, {})
    with pytest.raises(ConflictError, match="does not wait for an audit"):
        store.review(part_id, action=ReviewAction.CORRECT, text="KX4", who="Ada", token="Ada", audit=True)


def test_the_estimate_counts_what_reviews_have_said_of_those_read_otherwise(store: Store) -> None:
    right = [audited(store) for _ in range(3)]
    mistyped, wrong, disputed, unreadable, waiting, found_before = (audited(store) for _ in range(6))
    for part_id in right:
        store.review(part_id, action=ReviewAction.CORRECT, text="KX4", who="Ada", token="Ada", audit=True)
    for part_id in (mistyped, wrong, disputed):
        store.review(part_id, action=ReviewAction.CORRECT, text="KX7", who="Ada", token="Ada", audit=True)
        assert store.part(part_id).state is PartState.REVIEW
    store.review(unreadable, action=ReviewAction.UNREADABLE, text="", who="Ada", token="Ada", audit=True)
    assert store.part(unreadable).state is PartState.ACCEPTED
    said(store, mistyped, GRACE, "KX4", readers=1)
    said(store, wrong, GRACE, "KX7", readers=1)
    said(store, found_before, GRACE, "KX9", readers=1)  # by whoever complained, before its audit
    figures = store.audit_figures(START)
    assert (figures.drawn, figures.waiting, figures.disputed, figures.not_judged) == (9, 1, 1, 1)
    assert figures.accepted_wrong == share(2, 6, exact=True)
    assert [p.id for p in store.queue(audits=True)] == [waiting]
    assert store.audit_figures(START + timedelta(hours=1)).drawn == 0


def test_a_part_read_anew_and_no_longer_accepted_is_dropped(store: Store) -> None:
    part_id = audited(store)
    store.add_readings(part_id, readings=(reading("KX5", "fused", "review"),), state=PartState.REVIEW)
    assert store.queue(audits=True) == ()
    assert store.audit_figures(START).drawn == 0
