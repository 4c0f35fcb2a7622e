"""The dashboard's figures, against the same counted in Python over what the store gives back."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from pipeline.common.records import PartState
from pipeline.store.errors import UnfitError
from pipeline.store.store import Store
from tests.support.store_samples import PLAN, START, Clock, correct, reading, received


def test_nothing_yet(store: Store) -> None:
    figures = store.statistics(START - timedelta(hours=1))
    assert (figures.parts, figures.reviewed, figures.awaiting, figures.rejects) == (0, 0, 0, 0)
    assert (figures.by_state, figures.seconds) == ({}, {})
    assert [s.parts for s in figures.trend] == [0, 0]
    assert figures.trend[0].at == START.replace(minute=0) - timedelta(hours=1)


def test_a_line_of_parts(store: Store, clock: Clock) -> None:
    """Parts of every fate at seeded random, over seven hours; the figures begin after the second."""
    rng, since = np.random.default_rng(5), START + timedelta(hours=2)
    counts: Counter[str] = Counter()
    for _ in range(120):
        clock.go_on(seconds=float(rng.uniform(0, 400)))
        counted = clock.at >= since

        def timed(source: str, decision: str) -> object:
            return replace(reading("KX407251", source, decision), seconds=round(rng.exponential(), 6))

        by_camera = bool(rng.random() < 0.5)
        if by_camera:
            part = received(store, readings=(timed("vision", "accept"),))
        else:
            seen = (timed("vision", "review"),)
            part = received(store, PartState.TOUCH_NEEDED, readings=seen, plan=PLAN)
            decision = ("accept", "review", "reject")[rng.integers(3)]
            state = PartState.ACCEPTED if decision == "accept" else PartState.REVIEW
            part = store.add_readings(part.id, readings=(timed("fused", decision),), state=state)
        counts += Counter(by_camera=by_camera * counted, fell_back=(not by_camera) * counted)
        # KX40725 was read with a character too many: 6 of 7
        truth, n_right = (("KX407251", 8), ("KX407257", 7), ("KX40725", 6), ("", 0))[rng.integers(4)]
        if part.state is PartState.REVIEW and rng.random() < 0.7:
            if rng.random() < 0.5:
                correct(store, part.id, "ZZZ", "Bob")  # the first word does not count, the last does
            correct(store, part.id, truth)
            right = truth == "KX407251"
            said = Counter(reviewed=1, right_before_review=right, characters_reviewed=len(truth))
            counts += Counter({name: n * counted for name, n in said.items()})
            counts += Counter(characters_right=n_right * counted)
    figures = store.statistics(since)
    assert {name: getattr(figures, name) for name in counts} == counts
    listed = [p for p in store.parts(limit=1000) if p.created_at >= since]
    assert figures.parts == len(listed) == sum(s.parts for s in figures.trend)
    assert figures.by_state == Counter(p.state for p in listed)
    assert figures.rejects == sum(p.reading is not None and p.reading.decision == "reject" for p in listed)
    assert figures.awaiting == len(store.queue(limit=1000))
    hours = Counter(p.created_at.replace(minute=0, second=0, microsecond=0) for p in listed)
    assert {s.at: s.parts for s in figures.trend if s.parts} == hours
    starts = [s.at for s in figures.trend]
    assert starts == [starts[0] + timedelta(hours=k) for k in range(len(starts))]
    assert starts[0] <= since < starts[0] + timedelta(hours=1)
    assert starts[-1] <= clock.at < starts[-1] + timedelta(hours=1)
    read = [
        r for p in store.parts(limit=1000) for r in store.readings(p.id) if r.at is not None and r.at >= since
    ]
    for source in ("vision", "fused"):
        ranked = sorted(r.seconds for r in read if r.source == source)
        nearest = tuple(ranked[math.ceil(q * len(ranked)) - 1] for q in (0.5, 0.99))
        assert figures.seconds[source] == pytest.approx(nearest, abs=0.00051)  # told to the millisecond
    # other zones are the same instants
    assert store.statistics(since.astimezone()) == figures


@pytest.mark.parametrize("n", [1, 2, 99, 100, 101])
def test_percentiles_are_nearest_ranks(store: Store, n: int) -> None:
    readings = tuple(replace(reading("K"), seconds=float(k)) for k in range(n, 0, -1))
    received(store, readings=readings)
    assert store.statistics(START).seconds == {"vision": (math.ceil(n / 2), math.ceil(99 * n / 100))}


def test_photo_and_scan_at_once_is_no_fallback(store: Store) -> None:
    received(store, readings=(reading("KX4", "vision", "review"), reading("KX4", "fused")))
    figures = store.statistics(START)
    assert (figures.parts, figures.fell_back, figures.by_camera) == (1, 0, 0)


def test_times_that_cannot_be(store: Store) -> None:
    for wrong in (START.replace(tzinfo=None), START - timedelta(days=4000)):
        with pytest.raises(UnfitError, match="give a time"):
            store.statistics(wrong)
    # nothing has happened in time to come
    assert store.statistics(START + timedelta(days=1)).trend == ()
