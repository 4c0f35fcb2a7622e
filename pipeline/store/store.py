"""The store: everything the service remembers, in SQLite or PostgreSQL.

Every method is one transaction. What a writing method returns is on the disk; where it raises, nothing has changed.
Threads and processes may use a store at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from pipeline.common.records import (
    Delivery,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReadingRecord,
    ReviewAction,
    ReviewRecord,
    ScanPlanRecord,
    Scope,
    TokenRecord,
)
from pipeline.store import evidence_index as store_evidence
from pipeline.store import outbox as store_outbox
from pipeline.store import parts as store_parts
from pipeline.store import reviews as store_reviews
from pipeline.store import tokens as store_tokens
from pipeline.store.database import open_database
from pipeline.store.errors import AlreadyDoneError, ConflictError, NotFoundError, StoreError, UnfitError
from pipeline.store.looks import StoreLooks
from pipeline.store.parts import Idempotency, Reads

__all__ = [
    "AlreadyDoneError",
    "ConflictError",
    "Idempotency",
    "NotFoundError",
    "Store",
    "StoreError",
    "UnfitError",
]


class Store(StoreLooks):
    """Parts and what is known of them.

    Every method raises StoreError where the database does not answer, UnfitError (a StoreError and a ValueError) for
    values that cannot be stored, and NotFoundError for parts and tokens that are not there.
    """

    @classmethod
    def open(cls, url: str, *, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> Store:
        """Open a store, made or brought up to date first.

        Args:
            url: sqlite:///file.db or postgresql://user:password@host/name.
            now: the clock.

        Raises:
            StoreError: it cannot be opened, or was made by a newer version.
        """
        return cls(open_database(url), now=now)

    def close(self) -> None:
        """Let go of the database."""
        self._database.close()

    # parts, written

    def add_part(
        self,
        *,
        part_id: str,
        name: str,
        state: PartState,
        readings: Sequence[ReadingRecord] = (),
        evidence: Sequence[EvidenceRecord] = (),
        expected: str = "",
        database: str = "",
        plan: ScanPlanRecord | None = None,
        targets: Sequence[str] = (),
        idempotency: Idempotency | None = None,
    ) -> PartRecord:
        """Receive a part with what was read of it.

        Args:
            part_id: from `pipeline.common.part_id.new_part_id`.
            name: what the line calls it.
            state: how far it has come.
            readings: the first one first; the last one counts.
            evidence: files that are kept already.
            expected: text it should bear.
            database: glyph database asked for.
            plan: what to feel; with another state than TOUCH_NEEDED it says that the part was felt because of it.
            targets: where the result is published, unless touch is needed first.
            idempotency: of the request.

        Raises:
            AlreadyDoneError: the key is taken.
            ConflictError: the id is taken.
        """
        reads = Reads(state=state, readings=readings, evidence=evidence, plan=plan, targets=targets)
        with self._database.writing() as connection:
            return store_parts.add_part(
                connection,
                self._now(),
                part_id=part_id,
                name=name,
                expected=expected,
                database=database,
                reads=reads,
                request=idempotency,
            )

    def add_readings(
        self,
        part_id: str,
        *,
        readings: Sequence[ReadingRecord],
        state: PartState,
        plan: ScanPlanRecord | None = None,
        evidence: Sequence[EvidenceRecord] = (),
        targets: Sequence[str] = (),
        idempotency: Idempotency | None = None,
    ) -> PartRecord:
        """Add what was read of a part later; arguments as `add_part`.

        Raises:
            AlreadyDoneError: the key is taken.
            ConflictError: the part was reviewed meanwhile.
        """
        reads = Reads(state=state, readings=readings, evidence=evidence, plan=plan, targets=targets)
        with self._database.writing() as connection:
            return store_parts.add_readings(
                connection, self._now(), part_id, reads=reads, request=idempotency
            )

    def review(
        self,
        part_id: str,
        *,
        action: ReviewAction,
        text: str,
        who: str,
        token: str = "",
        note: str = "",
        before: str | None = None,
        targets: Sequence[str] = (),
    ) -> PartRecord:
        """Write down what a person says of a part; it may be said anew, and what was said before stays.

        Args:
            part_id: of which part.
            action: what the person did; an unreadable part has no text, whatever is given.
            text: right one; to confirm, the text as it stands or none.
            who: the person.
            token: name of the token used.
            note: anything.
            before: the text that the person saw.
            targets: where the part is published.

        Raises:
            ConflictError: the text is no longer what the person saw.
        """
        said = ReviewRecord(action=action, before="", after=text, who=who, token=token, note=note)
        with self._database.writing() as connection:
            return store_reviews.add_review(
                connection, self._now(), part_id, said=said, seen=before, targets=targets
            )

    def note_event(self, part_id: str, kind: str, data: Mapping[str, Any]) -> None:
        """Note that something happened to a part, such as its enrolment."""
        with self._database.writing() as connection:
            store_parts.note_event(connection, self._now(), part_id, kind, data)

    def forget_keys(self, before: datetime) -> int:
        """Forget idempotency keys of before a time, and say how many."""
        with self._database.writing() as connection:
            return store_parts.forget_keys(connection, before)

    # results to be published

    def due(self, *, limit: int = 20) -> tuple[Delivery, ...]:
        """What is to be sent now; of one part to one target only the eldest."""
        with self._database.reading() as connection:
            return store_outbox.due(connection, self._now(), limit=limit)

    def delivered(self, delivery_id: int) -> None:
        """It has arrived."""
        with self._database.writing() as connection:
            store_outbox.delivered(connection, delivery_id)

    def postpone(self, delivery_id: int, *, error: str, until: datetime) -> None:
        """It has not arrived, and is to be sent again."""
        with self._database.writing() as connection:
            store_outbox.postpone(connection, delivery_id, error=error, until=until)

    def undelivered(self) -> int:
        """How many results wait to be sent."""
        with self._database.reading() as connection:
            return store_outbox.undelivered(connection)

    # files

    def evidence_before(self, when: datetime, limit: int = 200) -> tuple[tuple[str, EvidenceRecord], ...]:
        """(part id, file) of files from before a time that are still kept, oldest first."""
        with self._database.reading() as connection:
            return store_evidence.evidence_before(connection, when, limit=limit)

    def evidence_gone(self, part_id: str, sha256: str) -> bool:
        """Note that a part's file is no longer kept; True if no part needs that file any more."""
        with self._database.writing() as connection:
            return store_evidence.evidence_gone(connection, self._now(), part_id, sha256)

    def known_hashes(self) -> frozenset[str]:
        """Hashes of every file that is needed."""
        with self._database.reading() as connection:
            return store_evidence.known_hashes(connection)

    # tokens

    def add_token(self, name: str, scopes: Iterable[Scope], *, expires_at: datetime | None = None) -> str:
        """Make a token.

        Returns:
            Its secret, which is kept nowhere.

        Raises:
            ConflictError: the name was given before.
        """
        with self._database.writing() as connection:
            return store_tokens.add_token(connection, self._now(), name, scopes, expires_at=expires_at)

    def token(self, secret: str) -> TokenRecord | None:
        """The token with that secret; None if it is unknown, expired or revoked."""
        with self._database.reading() as connection:
            return store_tokens.token(connection, self._now(), secret)

    def tokens(self) -> tuple[TokenRecord, ...]:
        """Every token, oldest first, also those that are refused."""
        with self._database.reading() as connection:
            return store_tokens.all_tokens(connection)

    def revoke(self, name: str) -> None:
        """Refuse a token from now on."""
        with self._database.writing() as connection:
            store_tokens.revoke(connection, self._now(), name)
