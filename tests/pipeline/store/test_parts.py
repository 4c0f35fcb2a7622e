"""What is written of a part comes back as it was, in every database, and when many write at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.common.people_records import Person
from pipeline.common.reading_records import ScanPlanRecord, to_json
from pipeline.common.records import EvidenceKind, PartState, ReviewAction
from pipeline.store.errors import AlreadyDoneError, ConflictError, NotFoundError, StoreError, UnfitError
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store
from tests.support.store_samples import (
    PHOTO,
    PLAN,
    SCAN,
    START,
    Clock,
    at_any_time,
    correct,
    due,
    race,
    reading,
    received,
)


def _kinds(store: Store, part_id: str) -> list[str]:
    return [event.kind for event in store.story(part_id).events]


def test_the_text_of_a_part_in_review_is_published_as_a_candidate(store: Store) -> None:
    part = received(store, PartState.REVIEW, targets=("mqtt",))
    assert part.text
    correct(store, part.id, "B77", targets=("mqtt",))
    sent = [next(iter(due(store)))]
    store.delivered(sent[0].id)
    sent += due(store)
    assert [(d.payload["state"], d.payload["text"], d.payload.get("candidate")) for d in sent] == [
        ("review", "", part.text),
        ("reviewed", "B77", None),
    ]


def test_the_camera_is_sure(store: Store) -> None:
    request = {"expected": "KX407251", "database": "line 3.glyphs", "job": "left", "line": "press"}
    part = received(store, name="plate 7", evidence=(PHOTO,), targets=("mqtt", "webhook"), **request)
    assert part == store.part(part.id)
    assert {name: getattr(part, name) for name in request} == request
    assert (part.name, part.state, part.text) == ("plate 7", PartState.ACCEPTED, "KX407251")
    assert (part.plan, part.review, part.touch) == (None, None, None)
    assert part.created_at == part.changed_at == START
    assert part.reading == replace(reading(), at=START)
    assert store.story(part.id).readings == (part.reading,)
    assert store.evidence(part.id) == (replace(PHOTO, at=START),)
    assert store.story(part.id).reviews == ()
    assert _kinds(store, part.id) == ["received", "read"]
    sent = due(store)
    assert [d.target for d in sent] == ["mqtt", "webhook"]
    assert sent[0].payload == to_json(part), "what is stored is what is sent"


def test_from_the_camera_to_touch_to_a_person(store: Store, clock: Clock) -> None:
    unsure = reading("KX4O7251", "vision", "review")
    later = {"readings": (unsure,), "evidence": (PHOTO,), "plan": PLAN, "targets": ("mqtt",)}
    part = received(store, PartState.TOUCH_NEEDED, **later)
    assert (part.plan, part.state, part.text) == (PLAN, PartState.TOUCH_NEEDED, "")
    assert [(d.payload["state"], d.payload["text"]) for d in due(store)] == [("touch_needed", "")]

    felt_at, felt = clock.go_on(seconds=8), reading("KX40725", "fused", "review")
    part = store.add_readings(part.id, readings=(felt,), state=PartState.REVIEW, evidence=(SCAN,))
    felt = replace(felt, at=felt_at)
    assert (part.plan, part.state, part.text) == (None, PartState.REVIEW, "KX40725")
    assert (part.created_at, part.changed_at, part.reading) == (START, felt_at, felt)
    assert [at_any_time(r) for r in store.story(part.id).readings] == [unsure, at_any_time(felt)]
    assert [e.kind for e in store.evidence(part.id)] == [EvidenceKind.PHOTO, EvidenceKind.SCAN]

    said_at = clock.go_on(minutes=3)
    answer = {"text": "KX407251", "note": "worn 1", "before": "KX40725"}
    part = store.review(part.id, person=Person("Ada", "line-3"), action=ReviewAction.CORRECT, **answer)
    assert (part.state, part.text, part.reading) == (PartState.REVIEWED, "KX407251", felt)
    review = part.review
    assert review is not None
    assert store.story(part.id).reviews == (review,)
    assert (review.before, review.after, review.who, review.at) == ("KX40725", "KX407251", "Ada", said_at)
    assert (review.token, review.note) == ("line-3", "worn 1")
    assert _kinds(store, part.id) == ["received", "read", "touch_needed", "read", "reviewed"]
    assert store.story(part.id).events[2].data == {"reason": "the camera is unsure", "seconds": 7.5}
    assert set(store.story(part.id).events[1].data) == {"source", "text", "decision", "confidence"}
    assert store.part(part.id) == part


@pytest.mark.parametrize(("plan", "asked"), [(PLAN, ["touch_needed"]), (None, [])])
def test_a_scan_of_the_same_request_is_a_fallback_where_it_was_asked_for(
    store: Store, plan: ScanPlanRecord | None, asked: list[str]
) -> None:
    both = (reading("KX4", "vision", "review"), reading("KX4", "fused"))
    part = received(store, readings=both, plan=plan)
    assert part.plan is None
    assert _kinds(store, part.id) == ["received", "read", *asked, "read"]
    figures = store.statistics(START)
    assert (figures.parts, figures.fell_back, figures.by_camera) == (1, len(asked), 0)


def test_reviews_are_added_never_replaced(store: Store, clock: Clock) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    answers = (
        (ReviewAction.CONFIRM, "", "KX4", "KX4"),
        (ReviewAction.UNREADABLE, "whatever stood in the form", "KX4", ""),
        (ReviewAction.CORRECT, "KX5", "", "KX5"),
        (ReviewAction.CONFIRM, "KX5", "KX5", "KX5"),
    )
    for action, text, before, _ in answers:
        clock.go_on(seconds=1)
        part = store.review(part.id, action=action, text=text, person=Person("Ada"), before=before)
    assert [(r.before, r.after) for r in store.story(part.id).reviews] == [
        (before, after) for *_, before, after in answers
    ]
    assert part.review == store.story(part.id).reviews[-1]
    accepted = received(store)
    part = store.review(accepted.id, action=ReviewAction.CORRECT, text="KX407257", person=Person("Ada"))
    assert (part.state, part.text) == (PartState.REVIEWED, "KX407257")


def test_the_second_of_two_people_is_told(store: Store) -> None:
    part = received(store, PartState.REVIEW, "KX4")
    store.review(part.id, action=ReviewAction.CORRECT, text="KX5", person=Person("Ada"), before="KX4")
    with pytest.raises(ConflictError, match=r"'KX5' by Ada meanwhile, no longer 'KX4'"):
        store.review(part.id, action=ReviewAction.CORRECT, text="KX6", person=Person("Bob"), before="KX4")
    with pytest.raises(ConflictError, match=r"'KX4' cannot be confirmed, for the text is 'KX5'"):
        store.review(part.id, action=ReviewAction.CONFIRM, text="KX4", person=Person("Bob"))
    with pytest.raises(ConflictError, match="reviewed by Ada meanwhile"):
        store.add_readings(part.id, readings=(reading(),), state=PartState.ACCEPTED)
    assert (len(store.story(part.id).reviews), len(store.story(part.id).readings)) == (1, 1)


@pytest.mark.parametrize(
    ("read", "said", "message"),
    [
        ("KX4", {"action": ReviewAction.CORRECT, "text": ""}, "no text; give it, or say"),
        ("KX4", {"action": ReviewAction.CORRECT, "text": "x" * 201}, "201 characters; give at most 200"),
        ("KX4", {"action": ReviewAction.CORRECT, "text": "K\x00"}, "NUL"),
        ("KX4", {"action": ReviewAction.CORRECT, "text": "K\ud800"}, "not UTF-8"),
        ("KX4", {"action": ReviewAction.CONFIRM, "text": "", "person": Person(" ")}, "say who"),
        ("KX4", {"action": ReviewAction.CONFIRM, "text": "", "note": "n" * 4001}, "the note has 4001"),
        ("", {"action": ReviewAction.CONFIRM, "text": ""}, "no text to confirm"),
    ],
)
def test_reviews_that_make_no_sense(store: Store, read: str, said: dict[str, Any], message: str) -> None:
    part = received(store, PartState.REVIEW, read)
    with pytest.raises(UnfitError, match=message):
        store.review(part.id, **{"person": Person("Ada"), **said})
    assert store.part(part.id) == part
    assert _kinds(store, part.id) == ["received", "read"]


def test_a_request_is_done_once(store: Store) -> None:
    request = IdempotencyKey("line-3:" + "k" * 5000 + "\x00\ud800", "photo a")
    assert store.find_request(request.key) is None
    part = received(store, idempotency=request)
    assert store.find_request(request.key) == ("photo a", part.id)
    with pytest.raises(AlreadyDoneError) as caught:
        received(store, idempotency=replace(request, fingerprint="photo b"), targets=("mqtt",))
    assert (caught.value.part_id, caught.value.fingerprint) == (part.id, "photo a")
    store.review(part.id, action=ReviewAction.CONFIRM, text="", person=Person("Ada"))
    with pytest.raises(AlreadyDoneError):
        store.add_readings(part.id, readings=(reading(),), state=PartState.REVIEW, idempotency=request)
    assert (len(store.parts()), len(store.story(part.id).readings), store.undelivered()) == (1, 1, 0)


def test_keys_are_forgotten_in_time(store: Store, clock: Clock) -> None:
    part = received(store, idempotency=IdempotencyKey("old", "f"))
    received(store, idempotency=IdempotencyKey.of_run("run", "part", "digest"))
    clock.go_on(days=2)
    received(store, idempotency=IdempotencyKey("new", "f"))
    assert store.forget_keys(clock.at) == 1
    assert store.find_request("old") is None
    assert store.find_request("new") is not None
    assert store.find_request(IdempotencyKey.of_run("run", "part", "digest").key) is not None
    assert store.part(part.id) == part


def test_an_id_is_given_once(store: Store) -> None:
    part = received(store)
    with pytest.raises(ConflictError, match="already; take a new id"):
        store.add_part(
            part_id=part.id, name="", state=PartState.REVIEW, idempotency=IdempotencyKey("another", "f")
        )
    assert store.find_request("another") is None
    assert store.part(part.id) == part


@pytest.mark.parametrize(
    "part_id", ["01KB0000000000000000000017", "", "../../etc/passwd", "x\x00", "\ud800", "'; DROP"]
)
def test_parts_that_are_not_there(store: Store, part_id: str) -> None:
    for ask in (store.part, store.evidence, store.story):
        with pytest.raises(NotFoundError, match="check the id"):
            ask(part_id)
    for change in (
        lambda: store.add_readings(part_id, readings=(reading(),), state=PartState.REVIEW),
        lambda: store.review(part_id, action=ReviewAction.UNREADABLE, text="", person=Person("Ada")),
        lambda: store.note_event(part_id, "enrolled", {}),
        lambda: store.evidence_gone(part_id, PHOTO.sha256),
    ):
        with pytest.raises(NotFoundError):
            change()


def test_values_that_no_database_holds(store: Store) -> None:
    for wrong in (
        {"name": "a\x00b"},
        {"name": "n" * 201},
        {"expected": "\ud800"},
        {"readings": (replace(reading(), height_mm=float("nan")),)},
        {"readings": (replace(reading(), confidence=float("inf")),)},
        {"evidence": (replace(PHOTO, sha256="../x"),)},
        {"evidence": (replace(PHOTO, meta={"width": float("nan")}),)},
    ):
        with pytest.raises(UnfitError):
            received(store, **wrong)
    with pytest.raises(UnfitError):
        store.add_part(part_id="7", name="", state=PartState.REVIEW)
    # half a part was written before the file was refused
    assert store.parts() == ()
    assert store.statistics(START).parts == 0


def test_names_of_files_are_mended_not_refused(store: Store) -> None:
    odd = replace(PHOTO, name="a\x00\udcff.png", meta={})
    part = received(store, evidence=(odd,), readings=(replace(reading("K\x00"), messages=("\ud800",)),))
    assert store.part(part.id) == part
    assert store.evidence(part.id)[0].name == "a\ufffd\ufffd.png"
    assert part.reading is not None
    assert (part.text, part.reading.text, part.reading.messages) == ("K\ufffd", "K\ufffd", ("\ufffd",))


_FIT = st.characters(exclude_categories=("Cs",), exclude_characters="\x00")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=10, deadline=None)
@given(
    name=st.text(_FIT, max_size=50),
    text=st.text(_FIT, max_size=20),
    confidence=st.floats(0.0, 1.0),
    data=st.dictionaries(st.text(st.characters(codec="ascii"), min_size=1), st.integers(-(2**53), 2**53)),
)
def test_any_text_and_number_comes_back(
    store: Store, name: str, text: str, confidence: float, data: dict[str, int]
) -> None:
    given_reading = replace(reading(text), confidence=confidence)
    part = received(store, name=name, readings=(given_reading,))
    data = {k.replace("\x00", "0"): v for k, v in data.items()}
    store.note_event(part.id, "enrolled", data)
    stored = store.part(part.id)
    assert (stored.name, stored.text, at_any_time(stored.reading)) == (name, text, given_reading)
    assert store.story(part.id).events[-1].data == data


def test_times_keep_their_instant_in_utc(store: Store, clock: Clock) -> None:
    clock.at = datetime.fromisoformat("2026-11-21T01:02:03.000004+09:00")
    part = store.part(received(store).id)
    assert (part.created_at, part.created_at.utcoffset()) == (clock.at, timedelta(0))
    changed_at = clock.go_on(seconds=5)
    store.note_event(part.id, "enrolled", {"database": "line 3.glyphs"})
    assert store.part(part.id) == replace(part, changed_at=changed_at)
    assert store.story(part.id).events[-1].data == {"database": "line 3.glyphs"}


def test_a_store_that_has_gone_away(store_url: str) -> None:
    store = Store.open(store_url)
    store.check_writable()
    if store_url.startswith("sqlite"):
        import os
        import sqlite3

        path = store_url.removeprefix("sqlite:///")
        with sqlite3.connect(path) as other:
            other.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        other.close()
        store.close()
        os.truncate(path, 100)
    else:
        import psycopg

        name = store_url.split("/")[3].split("?")[0]
        with psycopg.connect(store_url.replace(f"/{name}?", "/postgres?"), autocommit=True) as other:
            other.execute(f"DROP DATABASE {name} WITH (FORCE)".encode())
    damaged_or_gone = r"does not answer .*; check (that the database runs|its address, or stop the service)"
    with pytest.raises(StoreError, match=damaged_or_gone):
        store.check_writable()
    store.close()


def test_files_that_a_part_was_read_from_stand_for_it_as_long_as_they_are_there(
    store: Store, clock: Clock
) -> None:
    first = received(store, idempotency=IdempotencyKey.of_files(["a"]))
    both = IdempotencyKey.of_files(["a", "b"])
    second = received(store, idempotency=both)
    assert store.known_keys(["a", "b", "c"]) == {"a", "b"}
    with pytest.raises(AlreadyDoneError) as done:
        received(store, idempotency=IdempotencyKey.of_files(["a"]))
    assert done.value.part_id == first.id
    with pytest.raises(AlreadyDoneError) as done:
        received(store, idempotency=both)
    assert done.value.part_id == second.id
    assert store.forget_keys(clock() + timedelta(days=1)) == 0
    assert store.known_keys(map(str, range(25_000))) == frozenset()
    run = IdempotencyKey.of_run("run", "part", "digest")
    received(store, idempotency=run)
    clock.go_on(days=100)
    later = {"before": clock.at, "files_before": clock.at - timedelta(days=90)}
    store.renew_keys(["a", "c"], before=clock.at - timedelta(days=200))
    store.renew_keys(["b"], before=clock.at - timedelta(days=1))
    assert store.forget_keys(**later) == 2  # a, and the key of both
    assert store.known_keys(["a", "b", "c"]) == {"b"}
    assert store.find_request(run.key) is not None


def _refused(run: Callable[[int], Any]) -> Callable[[int], Any]:
    """What came of it; a refusal is what came of it."""

    def one(k: int) -> Any:
        try:
            return run(k)
        except ConflictError as error:
            return error

    return one


def test_one_of_many_equal_requests_makes_a_part(store: Store) -> None:
    for n in range(2):
        request = {
            "targets": ("mqtt",),
            "evidence": (PHOTO,),
            "idempotency": IdempotencyKey(f"line-3:{n}", "f"),
        }
        outcomes = race(_refused(lambda _, asked=request: received(store, **asked)))
        (part,) = [outcome for outcome in outcomes if not isinstance(outcome, Exception)]
        refused = [error for error in outcomes if isinstance(error, AlreadyDoneError)]
        assert len(refused) == len(outcomes) - 1
        assert {error.part_id for error in refused} == {part.id}
    assert (len(store.parts()), store.undelivered()) == (2, 2)


def test_one_of_many_people_is_first(store: Store) -> None:
    for _ in range(2):
        part = received(store, PartState.REVIEW, "KX4").id
        outcomes = race(
            _refused(lambda k, p=part: correct(store, p, f"KX{k:03d}", f"person {k}", before="KX4"))
        )
        (won,) = [s for s in outcomes if not isinstance(s, Exception)]
        assert all(type(s) is ConflictError for s in outcomes if s is not won)
        assert store.part(part) == won
        assert len(store.story(part).reviews) == 1


def test_a_scan_and_a_person_race(store: Store) -> None:
    for _ in range(2):
        part = received(store, PartState.TOUCH_NEEDED, "KX4").id

        def one(k: int, part: str = part) -> Any:
            if k == 0:
                return correct(store, part, "KX5")
            return store.add_readings(part, readings=(reading(f"KX{k}", "fused"),), state=PartState.ACCEPTED)

        n_felt = sum(not isinstance(came, Exception) for came in race(_refused(one))[1:])
        # whoever came after the person was refused, and the person has the last word
        readings, now = store.story(part).readings, store.part(part)
        assert len(readings) == 1 + n_felt
        assert (now.state, now.text, now.reading) == (PartState.REVIEWED, "KX5", readings[-1])
        # while touch is needed the part has no text
        assert store.story(part).reviews[0].before == (readings[-1].text if n_felt else "")
