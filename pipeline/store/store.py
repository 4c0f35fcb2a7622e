"""The store: all data of the service, in SQLite or PostgreSQL. An operation is a function that takes a transaction, in
the module of its tables; here each becomes a method of `Store`."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import datetime
from typing import Concatenate, ParamSpec, TypeVar

from pipeline.store import access, lists, outbox, rows
from pipeline.store import alerts as _alerts
from pipeline.store import parts as _parts
from pipeline.store import review as _review
from pipeline.store.database import Database, Transaction

P = ParamSpec("P")
R = TypeVar("R")


def _reads(operation: Callable[Concatenate[Transaction, P], R]) -> Callable[Concatenate[Store, P], R]:
    return _method(operation, Database.read_transaction)


def _writes(operation: Callable[Concatenate[Transaction, P], R]) -> Callable[Concatenate[Store, P], R]:
    return _method(operation, Database.write_transaction)


def _method(
    operation: Callable[Concatenate[Transaction, P], R],
    begin: Callable[[Database], AbstractContextManager[Transaction]],
) -> Callable[Concatenate[Store, P], R]:
    @functools.wraps(operation)
    def method(store: Store, /, *args: P.args, **options: P.kwargs) -> R:
        with begin(store) as tx:
            return operation(tx, *args, **options)

    return method


class Store(Database):
    """Parts and all that belongs to them; events of a part are added, never changed. Threads and processes may share
    it.

    Every method is one transaction, on the disk when it returns. Raises StoreError: the database does not answer.
    UnfitError (a StoreError): a value cannot be stored. NotFoundError: no such part or token.
    """

    # parts, and what has happened to them
    add_part = _writes(_parts.add_part)
    add_readings = _writes(_parts.add_readings)
    note_event = _writes(_parts.note_event)
    send_to_review = _writes(_parts.send_to_review)
    part = _reads(rows.part_by_id)
    story = _reads(_review.story)

    # parts that wait for touch
    waiting_for_touch = _reads(_parts.waiting_for_touch)
    give_up_touch = _writes(_parts.give_up_touch)

    # requests that are sent again
    find_request = _reads(_parts.find_request)
    known_keys = _reads(_parts.known_keys)
    renew_keys = _writes(_parts.renew_keys)
    forget_keys = _writes(_parts.forget_keys)

    # people: claims, reviews, audits of accepted parts
    claim_part = _writes(_review.claim_part)
    release_part = _writes(_review.release_part)
    claims = _reads(_review.claims)
    review = _writes(_review.review)
    undo_review = _writes(_review.undo_review)
    half_reviewed = _reads(_review.half_reviewed)
    audit_figures = _reads(_review.audit_figures)

    # lists of parts, and numbers about them
    parts = _reads(lists.find_parts)
    latest_named = _reads(lists.latest_named)
    queue = _reads(lists.queue)
    queue_length = _reads(lists.queue_length)
    next_in_queue = _reads(lists.next_in_queue)
    statistics = _reads(lists.statistics)
    agreement_by_day = _reads(lists.agreement_by_day)

    # alerts and golden parts
    alerts = _reads(_alerts.raised_alerts)
    look_for_alerts = _writes(_alerts.look_for_alerts)
    add_golden = _writes(_alerts.add_golden)
    golden_scans = _reads(_alerts.golden_scans)

    # results to be published
    lease = _writes(outbox.lease)
    release = _writes(outbox.release)
    delivered = _writes(outbox.delivered)
    postpone = _writes(outbox.postpone)
    still_waiting = _reads(outbox.still_waiting)
    undelivered = _reads(outbox.undelivered)
    waiting_results = _reads(outbox.waiting_results)

    # files
    evidence = _reads(rows.evidence_of)
    evidence_before = _reads(rows.evidence_before)
    evidence_gone = _writes(rows.evidence_gone)
    claim_evidence_folder = _writes(rows.claim_evidence_folder)
    needed_hashes = _reads(rows.needed_hashes)
    needed_after = _reads(rows.needed_after)

    def expire_evidence(self, before: datetime) -> int:
        """Record that files from before a time are no longer kept, and their number; the next `sweep` removes them."""
        n = 0
        while batch := self.evidence_before(before):
            for part_id, sha256 in batch:
                self.evidence_gone(part_id, sha256)
            n += len(batch)
        return n

    def every_needed_hash(self) -> Iterator[str]:
        hashes: tuple[str, ...] = ("",)
        while hashes := self.needed_after(hashes[-1]):
            yield from hashes

    # tokens and sessions
    add_token = _writes(access.add_token)
    token = _reads(access.token)
    tokens = _reads(access.all_tokens)
    revoke = _writes(access.revoke)
    open_session = _writes(access.open_session)
    session_token = _reads(access.session_token)
    close_session = _writes(access.close_session)
