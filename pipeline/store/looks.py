"""How the store is looked at: the half of `pipeline.store.store.Store` that changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

import sqlalchemy as sa

from pipeline.common.records import (
    EventRecord,
    EvidenceRecord,
    Figures,
    PartRecord,
    PartState,
    ReadingRecord,
    ReviewRecord,
)
from pipeline.store import lists as store_lists
from pipeline.store import parts as store_parts
from pipeline.store import rows as store_rows
from pipeline.store import statistics as store_figures
from pipeline.store.database import Database


class StoreLooks:
    """Parts as they stand, what happened to them, lists and figures of them."""

    def __init__(self, database: Database, *, now: Callable[[], datetime]) -> None:
        self._database = database
        self._now = now

    def ping(self) -> None:
        """Ask the database for an answer."""
        with self._database.reading() as connection:
            connection.execute(sa.select(sa.literal(1))).scalar_one()

    def part(self, part_id: str) -> PartRecord:
        """A part as it stands."""
        with self._database.reading() as connection:
            return store_rows.part_by_id(connection, part_id)

    def readings(self, part_id: str) -> tuple[ReadingRecord, ...]:
        """A part's readings, the first one first."""
        with self._database.reading() as connection:
            store_rows.check_part(connection, part_id)
            return store_rows.readings_of(connection, part_id)

    def evidence(self, part_id: str) -> tuple[EvidenceRecord, ...]:
        """A part's files, the first one first, also those that are gone."""
        with self._database.reading() as connection:
            store_rows.check_part(connection, part_id)
            return store_rows.evidence_of_part(connection, part_id)

    def reviews(self, part_id: str) -> tuple[ReviewRecord, ...]:
        """What people said of a part, the first one first."""
        with self._database.reading() as connection:
            store_rows.check_part(connection, part_id)
            return store_rows.reviews_of(connection, part_id)

    def history(self, part_id: str) -> tuple[EventRecord, ...]:
        """What happened to a part, in order."""
        with self._database.reading() as connection:
            store_rows.check_part(connection, part_id)
            return store_rows.events_of(connection, part_id)

    def parts(
        self,
        *,
        state: PartState | None = None,
        text: str = "",
        name: str = "",
        before: str | None = None,
        limit: int = 50,
    ) -> tuple[PartRecord, ...]:
        """Parts, newest first.

        Args:
            state: they are in.
            text: that theirs holds, in upper or lower case.
            name: that theirs holds, likewise.
            before: id of the last part of the page before.
            limit: most of them.
        """
        with self._database.reading() as connection:
            return store_lists.find_parts(
                connection, state=state, text=text, name=name, before=before, limit=limit
            )

    def queue(self, *, limit: int = 50) -> tuple[PartRecord, ...]:
        """Parts that a person is to look at, oldest first."""
        with self._database.reading() as connection:
            return store_lists.queue(connection, limit=limit)

    def next_in_queue(self, after: str | None = None) -> PartRecord | None:
        """The oldest part to look at after that one, else the oldest, else None."""
        with self._database.reading() as connection:
            return store_lists.next_in_queue(connection, after)

    def reviewed(
        self, *, since: datetime | None = None, after: str | None = None, limit: int = 1000
    ) -> tuple[PartRecord, ...]:
        """Parts that a person has looked at, by their ids, oldest first.

        Args:
            since: earliest time of their last review.
            after: id of the last part of the page before.
            limit: most of them.
        """
        with self._database.reading() as connection:
            return store_lists.reviewed(connection, since=since, after=after, limit=limit)

    def figures(self, since: datetime) -> Figures:
        """The dashboard's figures since a time, at most ten years ago."""
        with self._database.reading() as connection:
            return store_figures.figures(connection, self._now(), since)

    def remembered(self, key: str) -> tuple[str, str] | None:
        """(fingerprint, part id) of the request with that idempotency key; None if there was none."""
        with self._database.reading() as connection:
            return store_parts.remembered(connection, key)
