"""Results waiting to be published: written with the part, removed when the receiver has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from pipeline.common.record_json import to_json
from pipeline.common.records import Delivery, PartRecord
from pipeline.store.database import Transaction
from pipeline.store.errors import cleaned, fit, fit_limit
from pipeline.store.tables import outbox

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
                due_at=tx.now,
            )
        )


def due(tx: Transaction, *, limit: int = 20) -> tuple[Delivery, ...]:
    """What is to be sent now, longest due first; of a part and a target only the eldest, so that order is kept."""
    elder = outbox.alias()
    waits = sa.exists().where(
        elder.c.part_id == outbox.c.part_id, elder.c.target == outbox.c.target, elder.c.id < outbox.c.id
    )
    rows = tx.execute(
        sa.select(outbox)
        .where(outbox.c.due_at <= tx.now, ~waits)
        .order_by(outbox.c.due_at, outbox.c.id)
        .limit(fit_limit(limit))
    )
    return tuple(Delivery(row.id, row.target, row.part_id, row.payload, row.attempts) for row in rows)


def delivered(tx: Transaction, delivery_id: int) -> None:
    """Forget a result that has arrived; nothing happens where it was forgotten before."""
    tx.execute(sa.delete(outbox).where(outbox.c.id == delivery_id))


def postpone(tx: Transaction, delivery_id: int, *, error: str, until: datetime) -> None:
    """Note that a result has not arrived, and is to be sent again."""
    tx.execute(
        sa.update(outbox)
        .where(outbox.c.id == delivery_id)
        .values(attempts=outbox.c.attempts + 1, error=cleaned(error)[:_MAX_ERROR], due_at=until)
    )


def undelivered(tx: Transaction) -> int:
    """How many results wait to be sent."""
    n: int = tx.execute(sa.select(sa.func.count()).select_from(outbox)).scalar_one()
    return n
