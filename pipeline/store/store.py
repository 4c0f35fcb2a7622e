"""The store: everything the service remembers, in SQLite or PostgreSQL.

An operation is a function of a transaction, written and described where its tables are; here each becomes a method of
`Store`, with the same arguments but the transaction's. Threads and processes may use a store at once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager
from datetime import datetime
from typing import Concatenate, ParamSpec, TypeVar

import sqlalchemy as sa

from pipeline.store import alerts as _alerts
from pipeline.store import audits as _audits
from pipeline.store import claims as _claims
from pipeline.store import evidence_index, idempotency, lists, outbox, rows, sessions
from pipeline.store import golden as _golden
from pipeline.store import parts as _parts
from pipeline.store import reviews as _reviews
from pipeline.store import shadow as _shadow
from pipeline.store import statistics as _statistics
from pipeline.store import tokens as _tokens
from pipeline.store import touch as _touch
from pipeline.store.database import Database, Transaction, open_database, utc_now
from pipeline.store.errors import (
    AlreadyDoneError,
    ClaimedError,
    ConflictError,
    NotFoundError,
    StoreError,
    UnfitError,
)
from pipeline.store.idempotency import IdempotencyKey
from pipeline.store.seals import seal_written

__all__ = [
    "AlreadyDoneError",
    "ClaimedError",
    "ConflictError",
    "IdempotencyKey",
    "NotFoundError",
    "Store",
    "StoreError",
    "UnfitError",
]

P = ParamSpec("P")
R = TypeVar("R")


def _reads(operation: Callable[Concatenate[Transaction, P], R]) -> Callable[Concatenate[Store, P], R]:
    return _method(operation, Database.reading)


def _writes(operation: Callable[Concatenate[Transaction, P], R]) -> Callable[Concatenate[Store, P], R]:
    @functools.wraps(operation)
    def sealed(tx: Transaction, /, *args: P.args, **options: P.kwargs) -> R:
        done = operation(tx, *args, **options)
        seal_written(tx)
        return done

    return _method(sealed, Database.writing)


def _method(
    operation: Callable[Concatenate[Transaction, P], R],
    begin: Callable[[Database], AbstractContextManager[Transaction]],
) -> Callable[Concatenate[Store, P], R]:
    """The operation as a method that begins its transaction itself."""

    @functools.wraps(operation)
    def method(store: Store, /, *args: P.args, **options: P.kwargs) -> R:
        with begin(store.database) as tx:
            return operation(tx, *args, **options)

    return method


def _ping(tx: Transaction) -> None:
    """Ask the database for an answer."""
    tx.execute(sa.select(sa.literal(1))).scalar_one()


class Store:
    """Parts and what is known of them.

    * Every method is one transaction. What a writing method returns is on the disk; where it raises, nothing has
      changed.
    * Readings, reviews and events are only added, never changed, and sealed in chains (`pipeline.store.seals`).
    * Every method raises StoreError where the database does not answer, UnfitError (a StoreError and a ValueError) for
      values that cannot be stored, and NotFoundError for parts and tokens that are not there.
    """

    def __init__(self, database: Database) -> None:
        self.database = database

    @classmethod
    def open(cls, url: str, *, now: Callable[[], datetime] = utc_now, as_it_is: bool = False) -> Store:
        """Open a store, made or brought up to date first; arguments as `open_database`.

        Raises:
            StoreError: it cannot be opened, or was made by a newer version.
        """
        return cls(open_database(url, now=now, as_it_is=as_it_is))

    def close(self) -> None:
        """Let go of the database."""
        self.database.close()

    ping = _reads(_ping)

    # parts, and what happened to them
    add_part = _writes(_parts.add_part)
    add_readings = _writes(_parts.add_readings)
    note_event = _writes(_parts.note_event)
    review = _writes(_reviews.add_review)
    undo_review = _writes(_reviews.undo_review)
    part = _reads(rows.part_by_id)
    readings = _reads(rows.readings_of)
    evidence = _reads(rows.evidence_of)
    reviews = _reads(rows.reviews_of)
    history = _reads(rows.events_of)

    # parts that wait for touch
    waiting_for_stage = _reads(_touch.waiting_for_stage)
    waiting_for_touch = _reads(_touch.waiting_for_touch)
    ask_for_touch = _writes(_touch.ask_for_touch)
    give_up_touch = _writes(_touch.give_up_touch)

    # lists of parts, and numbers about them
    parts = _reads(lists.find_parts)
    queue = _reads(lists.queue)
    next_in_queue = _reads(lists.next_in_queue)
    reviewed = _reads(lists.reviewed)
    statistics = _reads(_statistics.statistics)
    agreement_by_day = _reads(_shadow.agreement_by_day)
    compared_parts = _reads(_shadow.compared_parts)

    # people: what they are at, second readings, audits of accepted parts
    claim_part = _writes(_claims.claim_part)
    take_over_part = _writes(_claims.take_over_part)
    release_part = _writes(_claims.release_part)
    claimed = _reads(_claims.claimed)
    opinions = _reads(_reviews.opinions)
    half_reviewed = _reads(_reviews.half_reviewed)
    audit = _reads(_audits.audit_of)
    audit_queue = _reads(_audits.audit_queue)
    next_audit = _reads(_audits.next_audit)
    add_audit = _writes(_audits.add_audit)
    audit_figures = _reads(_audits.audit_figures)

    # golden parts
    add_golden = _writes(_golden.add_golden)
    golden_scans = _reads(_golden.golden_scans)

    # alerts
    alerts = _reads(_alerts.raised_alerts)
    look_for_alerts = _writes(_alerts.look_for_alerts)

    # requests that are sent again
    remembered = _reads(idempotency.remembered)
    forget_keys = _writes(idempotency.forget_keys)

    # results to be published
    lease = _writes(outbox.lease)
    release = _writes(outbox.release)
    delivered = _writes(outbox.delivered)
    postpone = _writes(outbox.postpone)
    undelivered = _reads(outbox.undelivered)
    waiting_results = _reads(outbox.waiting_results)

    # files
    evidence_before = _reads(evidence_index.evidence_before)
    evidence_gone = _writes(evidence_index.evidence_gone)
    needed_hashes = _reads(evidence_index.needed_hashes)
    needed_after = _reads(evidence_index.needed_after)
    forget_files = _writes(evidence_index.forget_files)

    # tokens
    add_token = _writes(_tokens.add_token)
    token = _reads(_tokens.token)
    tokens = _reads(_tokens.all_tokens)
    revoke = _writes(_tokens.revoke)
    open_session = _writes(sessions.open_session)
    session_token = _reads(sessions.session_token)
    close_session = _writes(sessions.close_session)
