"""Results waiting to be published: written with the part, leased by one dispatcher, removed on arrival."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.records import Delivery, WaitingResults
from pipeline.store.database import JsonText, Transaction
from pipeline.store.errors import cleaned, fit
from pipeline.store.tables import outbox

# due time of a delivery that was never tried
AT_ONCE = datetime(1970, 1, 1, tzinfo=UTC)
# longest time between two attempts, and longest lease: a target or a service that is back is served within minutes
LONGEST_WAIT_S = LONGEST_LEASE_S = 300.0
_MAX_ERROR = 500
_FREE = {"owner": None, "leased_until": None}


def put_in_outbox(
    tx: Transaction, part_id: str, targets: Sequence[str], payload: Mapping[str, Any] | JsonText
) -> None:
    """Queue a part's record, or another message about it, for every target."""
    row: dict[str, Any] = {"part_id": part_id, "payload": payload, "attempts": 0, "error": ""}
    row |= {"created_at": tx.now, "due_at": AT_ONCE}
    for target in targets:
        tx.execute(sa.insert(outbox), row | {"target": fit(target, "the target", limit=32)})


def lease(
    tx: Transaction, owner: str, target: str, *, lease_s: float, limit: int = 100
) -> tuple[Delivery, ...]:
    """Lease the deliveries to send now, untried ones first; for `lease_s` only the owner sends them. Only the oldest of
    each part and target is given, so that order is kept, also among services."""
    # services on different machines share the database's clock; theirs may differ by more than a lease
    now = tx.execute(sa.select(sa.func.now())).scalar_one() if tx.postgresql else tx.now
    until, due, elder = outbox.c.leased_until, outbox.c.due_at, outbox.alias()
    waits = sa.exists().where(
        elder.c.part_id == outbox.c.part_id, elder.c.target == outbox.c.target, elder.c.id < outbox.c.id
    )
    # a lease or a wait that is longer than any was given by a clock that was set back since
    free = sa.or_(
        outbox.c.owner.is_(None),
        outbox.c.owner == owner,
        until <= now,
        until > now + timedelta(seconds=2.0 * LONGEST_LEASE_S),
    )
    is_due = sa.or_(due <= tx.now, due > tx.now + timedelta(seconds=LONGEST_WAIT_S))
    query = sa.select(outbox).where(outbox.c.target == target, free, is_due, ~waits)
    query = query.order_by(due, outbox.c.id).limit(limit)
    # another may be about to lease them
    if rows := tx.execute(query.with_for_update(skip_locked=True)).all():
        lease_all = sa.update(outbox).where(outbox.c.id.in_([row.id for row in rows]))
        ends = now + timedelta(seconds=min(lease_s, LONGEST_LEASE_S))
        tx.execute(lease_all.values(owner=fit(owner, "the owner", limit=32), leased_until=ends))
    return tuple(Delivery(row.id, row.target, row.part_id, row.payload, row.attempts) for row in rows)


def release(tx: Transaction, owner: str) -> None:
    """Release all leases of an owner that stops sending."""
    tx.execute(sa.update(outbox).where(outbox.c.owner == owner).values(**_FREE))


def delivered(tx: Transaction, delivery_id: int) -> None:
    """Remove a result that has arrived; nothing happens if it was removed before."""
    tx.execute(sa.delete(outbox).where(outbox.c.id == delivery_id))


def postpone(tx: Transaction, delivery_id: int, owner: str, *, error: str, wait_s: float) -> None:
    """Record that a result has not arrived, and when to send it again, unless its lease is another's by now."""
    later = {
        "attempts": outbox.c.attempts + 1,
        "error": cleaned(error)[:_MAX_ERROR],
        "due_at": tx.now + timedelta(seconds=min(wait_s, LONGEST_WAIT_S)),
    }
    leased = sa.and_(outbox.c.id == delivery_id, outbox.c.owner == owner)
    tx.execute(sa.update(outbox).where(leased).values(**later, **_FREE))


def waiting_results(tx: Transaction) -> Mapping[str, WaitingResults]:
    """Results that wait to be sent, by target."""
    query = sa.select(outbox.c.target, sa.func.count(), sa.func.min(outbox.c.created_at))
    return {name: WaitingResults(n, since) for name, n, since in tx.execute(query.group_by(outbox.c.target))}


def still_waiting(tx: Transaction, ids: Collection[int]) -> frozenset[int]:
    """Those of the deliveries that have not arrived yet, whoever sends them."""
    return frozenset(tx.execute(sa.select(outbox.c.id).where(outbox.c.id.in_(ids))).scalars())


def undelivered(tx: Transaction) -> int:
    """Number of results that wait to be sent."""
    return tx.count(outbox)
