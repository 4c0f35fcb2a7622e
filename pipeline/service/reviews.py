"""Reviews of parts by people: kept, counted and published."""

from __future__ import annotations

from typing import Any

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState
from pipeline.service.intake import Intake


class Reviews:
    """Keeps reviews, and publishes the parts as they stand after them."""

    def __init__(self, intake: Intake) -> None:
        self._intake, self._store, self.policy = intake, intake.store, intake.policy

    def review(self, part_id: str, **said: Any) -> PartRecord:
        """Keep a person's review of a part; arguments as `Store.review`.

        Raises:
            StoreError: as `Store.review`.
        """
        targets = self._intake.targets_of(self._store.part(part_id))
        part = self._store.review(part_id, targets=targets, readers=self.policy.readers, **said)
        self._intake.on_result()
        if part.state is PartState.REVIEWED and part.review is not None:
            self._intake.metrics.reviews.labels(part.review.action.value).inc()
        return part

    def undo(self, part_id: str, person: Person) -> PartRecord:
        """Take a person's own review back.

        Raises:
            StoreError: as `Store.undo_review`.
        """
        targets = self._intake.targets_of(self._store.part(part_id))
        part = self._store.undo_review(part_id, person=person, targets=targets)
        self._intake.on_result()
        return part
