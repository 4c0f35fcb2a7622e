"""Records to fill stores with, and a clock that goes on when it is told to."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import TypeVar

from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord, ScanPlanRecord
from pipeline.common.records import (
    Delivery,
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReviewAction,
)
from pipeline.store.store import Store

T = TypeVar("T")
START = datetime(2026, 11, 21, 9, 30, tzinfo=UTC)
PHOTO = EvidenceRecord(EvidenceKind.PHOTO, "a" * 64, 1000, "part 1.png", "image/png", {"mm_per_pixel": 0.05})
SCAN = EvidenceRecord(EvidenceKind.SCAN, "b" * 64, 2000, "part 1.h5")
PLAN = ScanPlanRecord(
    region_mm=(-5.0, -4.0, 25.0, 4.0),
    directions_deg=(0, 90),
    passes=4,
    line_pitch_mm=0.2,
    sample_pitch_mm=0.05,
    speed_mm_s=20.0,
    preload_mm=0.3,
    seconds=7.5,
    height_mm=5.0,
    reason="the camera is unsure",
)
STAGE_PLAN = ScanPlanRecord(
    region_mm=(2.0, 1.0, 14.0, 9.0),
    directions_deg=(0, 90, 180, 270),
    passes=1,
    line_pitch_mm=0.125,
    sample_pitch_mm=0.0625,
    speed_mm_s=50.0,
    preload_mm=1.0,
    seconds=1.0,
    height_mm=5.0,
    reason="to try it",
)
"""For a simulated stage."""


@dataclass
class Clock:
    """A clock for `Store.open(now=)`."""

    at: datetime = START

    def __call__(self) -> datetime:
        """The time."""
        return self.at

    def go_on(self, **by: float) -> datetime:
        """Let time pass, as timedelta takes it, and say what time it is."""
        self.at += timedelta(**by)
        return self.at


def reading(text: str = "KX407251", source: str = "vision", decision: str = "accept") -> ReadingRecord:
    """A reading whose every place has two candidates."""
    places = tuple(
        CharacterRecord(
            (CandidateRecord(c, 0.9, 0.8), CandidateRecord("8", 0.1, 0.5)),
            (k, 0.0, k + 0.6, 1.0),
            "read",
            "B",
        )
        for k, c in enumerate(text)
    )
    return ReadingRecord(
        source, text, decision, 0.93, places, ("a word", "Größe"), "gothic", 5.0, 0.2, seconds=0.4
    )


def received(
    store: Store,
    state: PartState = PartState.ACCEPTED,
    text: str = "KX407251",
    *,
    name: str = "part 1",
    **more: object,
) -> PartRecord:
    """A new part in the store, read once in a way that brings it to that state."""
    source = "vision" if state in (PartState.ACCEPTED, PartState.TOUCH_NEEDED) else "fused"
    decision = "accept" if state is PartState.ACCEPTED else "review"
    given = {"readings": (reading(text, source, decision),), **more}
    return store.add_part(part_id=new_part_id(), name=name, state=state, **given)


def correct(
    store: Store, part_id: str, text: str, person: str | Person = "Ada", **more: object
) -> PartRecord:
    """What a person says of a part; an empty text: that it is unreadable."""
    action = ReviewAction.CORRECT if text else ReviewAction.UNREADABLE
    by = Person(person) if isinstance(person, str) else person
    return store.review(part_id, person=by, action=action, text=text, **more)


def race(run: Callable[[int], T], n: int = 12) -> list[T]:
    """What came of it, begun by many threads at one moment."""
    line = threading.Barrier(n)

    def one(k: int) -> T:
        line.wait(30)
        return run(k)

    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))


def due(store: Store, *, limit: int = 20) -> tuple[Delivery, ...]:
    """What is to be sent now; asked again by the same owner, it is the same."""
    targets = ("mqtt", "webhook")
    found = (one for target in targets for one in store.lease("tests", target, lease_s=60.0, limit=limit))
    return tuple(sorted(found, key=lambda delivery: delivery.id))


def at_any_time(record: ReadingRecord | None) -> ReadingRecord | None:
    """A reading without the time that the store has given it."""
    return None if record is None else replace(record, at=None)
