"""Parts in shadow mode, and their agreement with the line's own reader."""

from __future__ import annotations

from datetime import timedelta

import pytest

from pipeline.common.records import Agreement, PartState, ShadowRecord
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, correct, reading, received

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
