"""Results waiting to be published: written with the part, removed when the receiver has them.

waiting --lease--> one dispatcher's --delivered--> gone
   ^                       |
   +--release, postpone----+      postponed, it is due later; when its lease runs out, it is as released

No delivery waits because a clock was set back: what was never tried is due whatever the time is, and nothing is put off
for longer than `LONGEST_WAIT_S`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.reading_records import to_json
from pipeline.common.records import Delivery, PartRecord, WaitingResults
from pipeline.store.database import Transaction
from pipeline.store.errors import cleaned, fit, fit_limit
from pipeline.store.tables import outbox

AT_ONCE = datetime(1970, 1, 1, tzinfo=UTC)
"""When that is due which was never tried."""
LONGEST_WAIT_S = 300.0
"""Between two attempts."""
LONGEST_LEASE_S = 300.0
_MAX_ERROR = 500


def put_in_outbox(
    tx: Transaction, part: PartRecord, targets: Sequence[str], *, payload: Mapping[str, Any] | None = None
) -> None:
    """Ask for the part, as it stands, or for something else about it to be sent to every target."""
    content = dict(payload) if payload is not None else to_json(part) if targets else {}
    for target in targets:
        tx.execute(
            sa.insert(outbox).values(
                part_id=part.id,
                target=fit(target, "the target", limit=32),
                payload=content,
                attempts=0,
                error="",
                created_at=tx.now,
                due_at=AT_ONCE,
            )
        )


def lease(
    tx: Transaction, owner: str, targets: Collection[str], *, lease_s: float, limit: int = 100
) -> tuple[Delivery, ...]:
    """Take what is to be sent now, longest due first: until the lease ends it is the owner's to send.

    Of a part and a target only the eldest is given, so that order is kept, also among services that share the store.
    What the owner itself has leased is given again; what another has, once its lease is over.

    Args:
        tx: the transaction.
        owner: name of a dispatcher that no other has.
        targets: that it can send to.
        lease_s: how long the others leave it alone, `LONGEST_LEASE_S` at most.
        limit: most of them for each target.
    """
    now = _lease_clock(tx)
    until = now + timedelta(seconds=min(lease_s, LONGEST_LEASE_S))
    free = sa.or_(
        outbox.c.owner.is_(None),
        outbox.c.owner == owner,
        outbox.c.leased_until <= now,
        # given by a clock that was set back since, and not just by a transaction that began a little later
        outbox.c.leased_until > now + timedelta(seconds=2.0 * LONGEST_LEASE_S),
    )
    ids = [found for target in sorted(targets) for found in _eldest_due(tx, target, free, fit_limit(limit))]
    if not ids:
        return ()
    # another may have been quicker: it leased them meanwhile, or is about to
    mine = sa.select(outbox).where(outbox.c.id.in_(ids), free).with_for_update(skip_locked=True)
    rows = {row.id: row for row in tx.execute(mine)}
    taken = sa.update(outbox).where(outbox.c.id.in_(list(rows)))
    tx.execute(taken.values(owner=fit(owner, "the owner", limit=32), leased_until=until))
    found = (rows[number] for number in ids if number in rows)
    return tuple(Delivery(row.id, row.target, row.part_id, row.payload, row.attempts) for row in found)


def _eldest_due(tx: Transaction, target: str, free: sa.ColumnElement[bool], limit: int) -> list[int]:
    elder = outbox.alias()
    waits = sa.exists().where(
        elder.c.part_id == outbox.c.part_id, elder.c.target == outbox.c.target, elder.c.id < outbox.c.id
    )
    due = outbox.c.due_at
    asked = sa.select(outbox.c.id, outbox.c.created_at, due).where(outbox.c.target == target, free, ~waits)
    # each along the index; what is due later than anything is ever put off was put off by a clock set back since
    of_all = (
        asked.where(due == AT_ONCE).order_by(outbox.c.id),
        asked.where(due > AT_ONCE, due <= tx.now).order_by(due, outbox.c.id),
        asked.where(due > tx.now + timedelta(seconds=LONGEST_WAIT_S)).order_by(due, outbox.c.id),
    )
    found = [row for one in of_all for row in tx.execute(one.limit(limit))]
    found.sort(key=lambda row: (row.created_at if row.due_at == AT_ONCE else row.due_at, row.id))
    return [row.id for row in found[:limit]]


def _lease_clock(tx: Transaction) -> datetime:
    # services on different machines share the database's clock; theirs may differ by more than a lease
    if not tx.postgresql:
        return tx.now
    now: datetime = tx.execute(sa.select(sa.func.now())).scalar_one()
    return now


def release(tx: Transaction, owner: str, delivery_ids: Collection[int]) -> None:
    """Leave to whoever comes first what the owner has leased and does not send."""
    mine = sa.and_(outbox.c.id.in_(list(delivery_ids)), outbox.c.owner == owner)
    tx.execute(sa.update(outbox).where(mine).values(owner=None, leased_until=None))


def delivered(tx: Transaction, delivery_id: int) -> None:
    """Forget a result that has arrived; nothing happens where it was forgotten before."""
    tx.execute(sa.delete(outbox).where(outbox.c.id == delivery_id))


def postpone(tx: Transaction, delivery_id: int, owner: str, *, error: str, wait_s: float) -> None:
    """Note that a result has not arrived, and is to be sent again after so long, `LONGEST_WAIT_S` at most.

    Nothing happens where its lease is another's by now.
    """
    tx.execute(
        sa.update(outbox)
        .where(outbox.c.id == delivery_id, outbox.c.owner == owner)
        .values(
            attempts=outbox.c.attempts + 1,
            error=cleaned(error)[:_MAX_ERROR],
            due_at=tx.now + timedelta(seconds=min(wait_s, LONGEST_WAIT_S)),
            owner=None,
            leased_until=None,
        )
    )


def waiting_results(tx: Transaction) -> Mapping[str, WaitingResults]:
    """Results that wait to be sent, by target."""
    asked = sa.select(
        outbox.c.target, sa.func.count().label("n"), sa.func.min(outbox.c.created_at).label("since")
    )
    rows = tx.execute(asked.group_by(outbox.c.target))
    return {row.target: WaitingResults(row.n, row.since) for row in rows}


def undelivered(tx: Transaction) -> int:
    """How many results wait to be sent."""
    n: int = tx.execute(sa.select(sa.func.count()).select_from(outbox)).scalar_one()
    return n
