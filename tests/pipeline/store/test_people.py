"""People at the store: claims, second readers who do not see what was read, audits of accepted parts."""

from __future__ import annotations

from datetime import timedelta

import pytest

from pipeline.common.names import HiddenCharacterError
from pipeline.common.people_records import Person
from pipeline.common.records import PartState, Scope
from pipeline.common.shares import share
from pipeline.store.errors import ClaimedError, ConflictError, NotFoundError
from pipeline.store.review import CLAIM_S
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, correct, race, reading, received

ADA, GRACE, MARY = (Person(name, token=name) for name in ("Ada", "Grace", "Mary"))
EVE, EVE_ELSEWHERE = Person("Eve", seat="one"), Person("Eve", seat="two")


def said(
    store: Store, part_id: str, by: Person, text: str, *, readers: int = 2, audit: bool = False
) -> PartState:
    """Where a part stands after a person has said what it reads."""
    about = {"readers": readers, "audit": audit}
    return correct(store, part_id, text, by, **about).state


# ---- claims


def test_a_claimed_part_is_one_persons_until_its_time_is_up(store: Store, clock: Clock) -> None:
    first, second = (received(store, PartState.REVIEW) for _ in range(2))
    claim = store.claim_part(first.id, ADA)
    assert (claim.who, claim.until) == ("Ada", START + timedelta(seconds=CLAIM_S))
    assert store.claim_part(first.id, GRACE) == claim
    assert store.claims() == {first.id: claim}
    assert (store.next_in_queue(person=GRACE), store.next_in_queue(person=ADA)) == (second, first)
    with pytest.raises(ClaimedError, match="Ada is at part"):
        said(store, first.id, GRACE, "KX1", readers=1)
    assert store.story(first.id).reviews == ()
    clock.go_on(seconds=CLAIM_S - 1.0)
    renewed = store.claim_part(first.id, ADA)
    clock.go_on(seconds=2.0)
    assert store.claim_part(first.id, GRACE) == renewed
    assert store.claim_part(first.id, GRACE, take_over=True).who == "Grace"
    clock.go_on(seconds=CLAIM_S)
    assert store.claims() == {}
    assert store.claim_part(first.id, ADA).who == "Ada"


def test_a_claim_of_a_clock_that_was_set_back_since_holds_nobody_up(store: Store, clock: Clock) -> None:
    part = received(store, PartState.REVIEW)
    store.claim_part(part.id, ADA)
    clock.go_on(days=-1.0)
    assert store.claims() == {}
    assert store.claim_part(part.id, GRACE).who == "Grace"
    assert said(store, part.id, GRACE, "KX1", readers=1) is PartState.REVIEWED


def test_a_claim_ends_with_the_review_or_when_it_is_let_go(store: Store) -> None:
    first, second = (received(store, PartState.REVIEW) for _ in range(2))
    until = max(store.claim_part(part.id, ADA).until for part in (first, second))
    said(store, first.id, ADA, "KX1", readers=1)
    store.release_part(second.id, GRACE, until=until)
    assert set(store.claims()) == {second.id}
    store.release_part(second.id, ADA, until=until)
    assert store.claims() == {}
    with pytest.raises(NotFoundError):
        store.claim_part("0" * 26, ADA)


def test_a_page_that_closes_late_does_not_end_the_claim_of_the_page_after_it(
    store: Store, clock: Clock
) -> None:
    part = received(store, PartState.REVIEW)
    first = store.claim_part(part.id, ADA)
    clock.go_on(seconds=1.0)
    store.claim_part(part.id, ADA)
    store.release_part(part.id, ADA, until=first.until)
    assert set(store.claims()) == {part.id}


def test_people_without_tokens_are_told_apart_by_their_browsers(store: Store) -> None:
    part = received(store, PartState.REVIEW)
    store.claim_part(part.id, EVE)
    assert store.next_in_queue(person=EVE_ELSEWHERE) is None
    # one who calls the interface without a token sits nowhere, and is let through
    assert said(store, part.id, Person("Bob"), "KX1", readers=1) is PartState.REVIEWED


def test_of_many_who_ask_at_once_one_has_the_part(store: Store) -> None:
    part = received(store, PartState.REVIEW)
    claims = race(lambda k: store.claim_part(part.id, Person(f"P{k}", seat=str(k))))
    assert len({claim.who for claim in claims}) == 1


# ---- two who agree


def test_a_part_is_reviewed_when_two_people_say_the_same(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    assert said(store, part.id, ADA, "KX1") is PartState.REVIEW
    assert (store.part(part.id).text, store.undelivered()) == ("KX4", 0)
    assert said(store, part.id, ADA, "KX1") is PartState.REVIEW  # nobody agrees with herself
    assert store.next_in_queue(person=ADA) is None
    assert store.next_in_queue(person=GRACE) == store.part(part.id)
    assert store.half_reviewed() == {part.id: 1}
    assert said(store, part.id, GRACE, "KX7") is PartState.REVIEW
    assert [o.after for o in store.story(part.id).opinions] == ["KX1", "KX7"]
    assert said(store, part.id, MARY, "KX1") is PartState.REVIEWED
    assert store.part(part.id).text == "KX1"
    story = store.story(part.id)
    assert (len(story.reviews), story.opinions, store.half_reviewed()) == (4, (), {})
    told = [dict(e.data) for e in story.events if e.kind == "read_by_person"]
    assert told == [{"who": "Ada"}, {"who": "Ada"}, {"who": "Grace"}], "not what was said"


@pytest.mark.parametrize("again", ["ANNA MÜLLER", " Anna  Müller", "Anna Mu\u0308ller", "Anna Müller\u00a0"])
def test_another_spelling_of_a_name_is_no_second_reader(store: Store, again: str) -> None:
    part = received(store, PartState.REVIEW)
    assert said(store, part.id, Person("Anna Müller"), "KX1") is PartState.REVIEW
    assert store.next_in_queue(person=Person(again)) is None
    assert said(store, part.id, Person(again), "KX1") is PartState.REVIEW
    assert list(store.half_reviewed().values()) == [1]
    assert said(store, part.id, Person("Anna Muller"), "KX1") is PartState.REVIEWED


def test_another_spelling_of_a_token_s_name_is_no_other_token(store: Store) -> None:
    store.add_token("Jörg", [Scope.REVIEW])
    for again in ("JÖRG", "jo\u0308rg", " Jörg "):
        with pytest.raises(ConflictError, match="is or was a token 'Jörg'"):
            store.add_token(again, [Scope.REVIEW])
    with pytest.raises(HiddenCharacterError):
        store.add_token("Jörg\u200b", [Scope.REVIEW])
    store.revoke("jörg")
    assert store.tokens()[0].revoked_at is not None


def test_two_who_cannot_read_it_agree_too_and_a_correction_needs_two_again(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    came = [
        said(store, part.id, by, text) for by, text in ((ADA, ""), (GRACE, ""), (ADA, "KX1"), (MARY, "KX1"))
    ]
    assert came == [PartState.REVIEW, PartState.REVIEWED] * 2
    assert said(store, part.id, GRACE, "KX1") is PartState.REVIEWED  # as it stands


# ---- audits


def audited(store: Store) -> str:
    """An accepted part that was drawn."""
    return received(store, PartState.ACCEPTED, "KX4", audit=True).id


def test_a_drawn_part_is_read_once_and_stays_accepted_where_it_is_the_same(store: Store) -> None:
    not_drawn = received(store, PartState.ACCEPTED, "KX4").id
    received(store, PartState.REVIEW, audit=True)  # not accepted: nothing to audit
    part_id = audited(store)
    assert [p.id for p in store.queue(audits=True)] == [part_id]
    drawn, other = store.story(part_id), store.story(not_drawn)
    assert (drawn.awaits_audit, drawn.audit, other.awaits_audit) == (True, None, False)
    store.claim_part(part_id, GRACE)
    assert store.next_in_queue(person=ADA, audits=True) is None
    with pytest.raises(ClaimedError):
        said(store, part_id, ADA, "KX4", audit=True)
    assert said(store, part_id, GRACE, "KX4", audit=True) is PartState.ACCEPTED
    audit = store.story(part_id).audit
    assert audit is not None
    assert (audit.before, audit.after, audit.who) == ("KX4", "KX4", "Grace")
    assert (store.queue(audits=True), store.undelivered(), store.claims()) == ((), 0, {})
    with pytest.raises(ConflictError, match="does not wait for an audit"):
        said(store, part_id, ADA, "KX4", audit=True)


def test_the_estimate_counts_what_reviews_have_said_of_those_read_otherwise(store: Store) -> None:
    for _ in range(3):
        said(store, audited(store), ADA, "KX4", audit=True)
    mistyped, wrong, _, unreadable, found_before = (audited(store) for _ in range(5))
    for part_id in store.queue(audits=True)[:3]:
        assert said(store, part_id.id, ADA, "KX7", audit=True) is PartState.REVIEW
    assert said(store, unreadable, ADA, "", audit=True) is PartState.ACCEPTED
    said(store, mistyped, GRACE, "KX4", readers=1)
    said(store, wrong, GRACE, "KX7", readers=1)
    said(store, found_before, GRACE, "KX9", readers=1)  # by whoever complained, before its audit
    waiting = audited(store)
    figures = store.audit_figures(START)
    assert (figures.drawn, figures.waiting, figures.disputed, figures.not_judged) == (9, 1, 1, 1)
    assert figures.accepted_wrong == share(2, 6, exact=True)
    assert [p.id for p in store.queue(audits=True)] == [waiting]
    assert store.audit_figures(START + timedelta(hours=1)).drawn == 0
    store.undo_review(wrong, person=GRACE)
    assert store.audit_figures(START).disputed == 2
    # one that is read anew, and no longer accepted, is dropped
    store.add_readings(waiting, readings=(reading("KX5", "fused", "review"),), state=PartState.REVIEW)
    assert (store.queue(audits=True), store.audit_figures(START).drawn) == ((), 8)
