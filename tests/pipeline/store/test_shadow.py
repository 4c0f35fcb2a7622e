"""Agreement with the line's own reader, counted by the database, against the same counted in Python."""

from __future__ import annotations

from collections import Counter
from datetime import timedelta

import numpy as np
import pytest

from pipeline.common.records import Agreement, PartState, ShadowRecord
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, correct, reading, received

WOULD_BE = (PartState.ACCEPTED, PartState.TOUCH_NEEDED, PartState.REVIEW)


def test_days_of_a_line(store: Store, clock: Clock) -> None:
    """Parts of every kind at seeded random, over days; ordinary ones between them do not count."""
    rng = np.random.default_rng(7)
    since = START + timedelta(days=1)
    everything: Counter[tuple[str, Agreement]] = Counter()
    accepted: Counter[tuple[str, Agreement]] = Counter()
    for _ in range(80):
        clock.go_on(hours=float(rng.uniform(0, 3)))
        if rng.uniform() < 0.2:
            received(store)
            continue
        kind, would_be = rng.choice(list(Agreement)), PartState(rng.choice(WOULD_BE))
        received(store, PartState.SHADOW, shadow=ShadowRecord(Agreement(kind), would_be))
        if clock.at >= since:
            key = (clock.at.date().isoformat(), Agreement(kind))
            everything[key] += 1
            accepted[key] += would_be is PartState.ACCEPTED
    with pytest.raises(UnfitError, match="time with its zone"):
        store.agreement_by_day(since.replace(tzinfo=None))
    assert store.agreement_by_day(clock.at + timedelta(hours=1)) == ()
    days = store.agreement_by_day(since)
    assert [d.day for d in days] == sorted(d.day for d in days)
    assert len(days) > 3
    for found, wanted in (("all_parts", everything), ("accepted", accepted)):
        told = {(d.day.isoformat(), kind): n for d in days for kind, n in getattr(d, found).items()}
        assert told == {key: n for key, n in wanted.items() if n}


def test_what_would_have_been_decided_is_kept(store: Store) -> None:
    kept = ShadowRecord(Agreement.OTHER, PartState.ACCEPTED)
    part = received(store, PartState.SHADOW, expected="KX407257", shadow=kept, targets=("mqtt",))
    assert (store.part(part.id).shadow, part.state) == (kept, PartState.SHADOW)
    assert received(store).shadow is None
    last = store.history(part.id)[-1]
    assert (last.kind, dict(last.data)) == ("compared", {"agreement": "other", "would_be": "accepted"})
    assert store.queue() == ()
    # a person's review keeps it, and a later reading changes it
    correct(store, part.id, "KX407257")
    assert store.part(part.id).shadow == kept
    again = received(store, PartState.SHADOW, shadow=kept)
    better = ShadowRecord(Agreement.SAME, PartState.REVIEW)
    read = store.add_readings(
        again.id, readings=(reading(source="fused"),), state=PartState.SHADOW, shadow=better
    )
    assert read.shadow == better


def test_disagreements_are_listed_newest_first_page_by_page(store: Store, clock: Clock) -> None:
    ids = []
    for k in range(7):
        clock.go_on(minutes=1)
        kind = Agreement.SAME if k == 3 else Agreement.OTHER
        part = received(store, PartState.SHADOW, shadow=ShadowRecord(kind, PartState.REVIEW))
        ids += [part.id] * (kind is Agreement.OTHER)
    first = store.parts(agreement=Agreement.OTHER, limit=4)
    rest = store.parts(agreement=Agreement.OTHER, before=first[-1].id, limit=4)
    assert [p.id for p in (*first, *rest)] == sorted(ids, reverse=True)
    with pytest.raises(UnfitError):
        store.parts(agreement=Agreement.OTHER, before="x")
