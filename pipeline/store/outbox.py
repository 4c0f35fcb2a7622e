"""Results waiting to be published: written with the part, removed when the receiver has them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from pipeline.common.record_json import to_json
from pipeline.common.records import Delivery, PartRecord
from pipeline.store.errors import cleaned, fit, fit_limit
from pipeline.store.tables import outbox

_MAX_ERROR = 500


def put_in_outbox(connection: Connection, now: datetime, part: PartRecord, targets: Sequence[str]) -> None:
    """Ask for the part, as it stands, to be sent to every target."""
    payload = to_json(part) if targets else {}
    for target in targets:
        connection.execute(
            sa.insert(outbox).values(
                part_id=part.id,
                target=fit(target, "the target", limit=32),
                payload=payload,
                attempts=0,
                error="",
                created_at=now,
                due_at=now,
            )
        )


def due(connection: Connection, now: datetime, *, limit: int) -> tuple[Delivery, ...]:
    """What is to be sent now, longest due first; of a part and a target only the eldest, so that order is kept."""
    elder = outbox.alias()
    waits = sa.exists().where(
        elder.c.part_id == outbox.c.part_id, elder.c.target == outbox.c.target, elder.c.id < outbox.c.id
    )
    rows = connection.execute(
        sa.select(outbox)
        .where(outbox.c.due_at <= now, ~waits)
        .order_by(outbox.c.due_at, outbox.c.id)
        .limit(fit_limit(limit))
    )
    return tuple(Delivery(row.id, row.target, row.part_id, row.payload, row.attempts) for row in rows)


def delivered(connection: Connection, delivery_id: int) -> None:
    """Forget what has arrived; nothing happens where it was forgotten before."""
    connection.execute(sa.delete(outbox).where(outbox.c.id == delivery_id))


def postpone(connection: Connection, delivery_id: int, *, error: str, until: datetime) -> None:
    """Try again later."""
    connection.execute(
        sa.update(outbox)
        .where(outbox.c.id == delivery_id)
        .values(attempts=outbox.c.attempts + 1, error=cleaned(error)[:_MAX_ERROR], due_at=until)
    )


def undelivered(connection: Connection) -> int:
    """How many wait."""
    return connection.execute(sa.select(sa.func.count()).select_from(outbox)).scalar_one()
