"""The dashboard's figures, against the same counted in Python over what the store gives back."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from pipeline.common.records import PartState, ReviewAction
from pipeline.store.store import Store, UnfitError
from tests.support.store_samples import PLAN, START, Clock, reading, received


def test_nothing_yet(store: Store) -> None:
    figures = store.statistics(START - timedelta(hours=1))
    assert (figures.parts, figures.reviewed, figures.awaiting, figures.rejects) == (0, 0, 0, 0)
    assert (figures.by_state, figures.seconds) == ({}, {})
    assert [s.parts for s in figures.trend] == [0, 0]
    assert figures.trend[0].at == START.replace(minute=0) - timedelta(hours=1)


def test_a_line_of_parts(store: Store, clock: Clock) -> None:
    """Parts of every fate at seeded random, over seven hours; the figures begin after the second."""
    rng = np.random.default_rng(5)
    since = START + timedelta(hours=2)
    seconds: dict[str, list[float]] = {}
    counts = dict.fromkeys(("parts", "camera", "fell", "rejects", "reviewed", "right", "characters", "ok"), 0)
    hours: dict[str, int] = {}
    for _ in range(120):
        clock.go_on(seconds=float(rng.uniform(0, 400)))
        counted = clock.at >= since

        def timed(source: str, decision: str, *, counted: bool = counted):
            took = float(np.round(rng.exponential(), 6))
            if counted:
                seconds.setdefault(source, []).append(took)
            return replace(reading("KX407251", source, decision), seconds=took)

        received_at = clock.at
        by_camera = bool(rng.random() < 0.5)
        if by_camera:
            part = received(store, readings=(timed("vision", "accept"),))
        else:
            seen = timed("vision", "review")
            part = received(store, PartState.TOUCH_NEEDED, readings=(seen,), plan=PLAN)
            decision = ("accept", "review", "reject")[rng.integers(3)]
            state = PartState.ACCEPTED if decision == "accept" else PartState.REVIEW
            part = store.add_readings(part.id, readings=(timed("fused", decision),), state=state)
        rejected = part.reading is not None and part.reading.decision == "reject"
        truth, n_right = (("KX407251", 8), ("KX407257", 7), ("KX40725", 7), ("", 0))[rng.integers(4)]
        looked_at = part.state is PartState.REVIEW and rng.random() < 0.7
        if looked_at:
            action = ReviewAction.CORRECT if truth else ReviewAction.UNREADABLE
            if rng.random() < 0.5:
                # the first word does not count, the last does
                store.review(part.id, action=ReviewAction.CORRECT, text="ZZZ", who="Bob")
            store.review(part.id, action=action, text=truth, who="Ada")
        if counted:
            counts["parts"] += 1
            counts["camera"] += by_camera
            counts["fell"] += not by_camera
            counts["rejects"] += rejected
            counts["reviewed"] += looked_at
            counts["right"] += looked_at and truth == "KX407251"
            counts["characters"] += len(truth) if looked_at else 0
            # KX40725 was read with a character too many: 6 of 7
            counts["ok"] += (6 if truth == "KX40725" else n_right) if looked_at else 0
            hours[received_at.strftime("%d %H")] = hours.get(received_at.strftime("%d %H"), 0) + 1
    figures = store.statistics(since)
    assert {
        "parts": figures.parts,
        "camera": figures.by_camera,
        "fell": figures.fell_back,
        "rejects": figures.rejects,
        "reviewed": figures.reviewed,
        "right": figures.right_before_review,
        "characters": figures.characters_reviewed,
        "ok": figures.characters_right,
    } == counts
    listed = [p for p in store.parts(limit=1000) if p.created_at >= since]
    for state in PartState:
        assert figures.by_state.get(state, 0) == sum(p.state is state for p in listed)
    assert figures.awaiting == len(store.queue(limit=1000))
    assert {s.at.strftime("%d %H"): s.parts for s in figures.trend if s.parts} == hours
    assert sum(s.parts for s in figures.trend) == figures.parts
    starts = [s.at for s in figures.trend]
    assert starts == [starts[0] + timedelta(hours=k) for k in range(len(starts))]
    assert starts[0] <= since < starts[0] + timedelta(hours=1)
    assert starts[-1] <= clock.at < starts[-1] + timedelta(hours=1)
    for source, took in seconds.items():
        ranked = sorted(took)
        nearest = tuple(ranked[math.ceil(q * len(ranked)) - 1] for q in (0.5, 0.99))
        # told to the millisecond
        assert figures.seconds[source] == pytest.approx(nearest, abs=0.00051)
    assert set(figures.seconds) == set(seconds)


@pytest.mark.parametrize("n", [1, 2, 99, 100, 101])
def test_percentiles_are_nearest_ranks(store: Store, n: int) -> None:
    readings = tuple(replace(reading("K"), seconds=float(k)) for k in range(n, 0, -1))
    received(store, readings=readings)
    assert store.statistics(START).seconds == {"vision": (math.ceil(n / 2), math.ceil(99 * n / 100))}


def test_photo_and_scan_at_once_is_no_fallback(store: Store) -> None:
    both = (reading("KX4", "vision", "review"), reading("KX4", "fused"))
    received(store, readings=both)
    figures = store.statistics(START)
    assert (figures.parts, figures.fell_back, figures.by_camera) == (1, 0, 0)


def test_other_zones_are_the_same_instants(store: Store) -> None:
    received(store)
    told = store.statistics(START.astimezone().replace(microsecond=0))
    assert told == store.statistics(START)
    assert told.parts == 1


def test_times_that_cannot_be(store: Store) -> None:
    for wrong in (START.replace(tzinfo=None), START - timedelta(days=4000)):
        with pytest.raises(UnfitError, match="give a time"):
            store.statistics(wrong)
    # nothing has happened in time to come
    assert store.statistics(START + timedelta(days=1)).trend == ()
