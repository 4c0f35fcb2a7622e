"""Alerts: raised once when something goes wrong, cleared once when it has gone right again, across restarts.

rate of the last n parts    limit ------/----\\------------ raised above
                            clear -----/------\\------/\\--- cleared at or below; between the two nothing happens
                                   ___/        \\____/
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import sqlalchemy as sa

from pipeline.common.records import AlertRecord, PartState
from pipeline.store.database import Transaction
from pipeline.store.errors import cleaned
from pipeline.store.outbox import put_in_outbox
from pipeline.store.rows import part_by_id
from pipeline.store.tables import alerts, parts

REJECT_RATE, REVIEW_RATE, DRIFT = "reject_rate", "review_rate", "drift"
_DECIDED = (PartState.ACCEPTED, PartState.REVIEW, PartState.REVIEWED)
_WORDS = {REJECT_RATE: "rejected", REVIEW_RATE: "sent to a person"}
_SIGMAS = 2.0
"""Below its limit by so many standard deviations of the window a rate is right again: less would be chance."""


def raised_alerts(tx: Transaction) -> tuple[AlertRecord, ...]:
    """Those that are raised now, the eldest first."""
    rows = tx.execute(sa.select(alerts).order_by(alerts.c.name))
    found = (AlertRecord(row.name, row.part_id, row.at, row.message) for row in rows)
    return tuple(sorted(found, key=lambda alert: alert.at))


def look_for_alerts(
    tx: Transaction,
    *,
    limits: Mapping[str, float],
    window: int,
    drifts: Mapping[str, str | None],
    others: Mapping[str, str | None] = MappingProxyType({}),
    targets: Sequence[str] = (),
) -> tuple[AlertRecord, ...]:
    """Raise and clear what is to be, and have it sent.

    Args:
        tx: the transaction.
        limits: highest rate of `REJECT_RATE` and `REVIEW_RATE`; 0: anything goes.
        window: latest parts that rates are of; with fewer none is told.
        drifts: how the parts differ from the certified ones, by job; empty where they do not, None where that is not
            known yet.
        others: the same of anything else, by the alert's name.
        targets: where alerts are sent.

    Returns:
        Those that were raised now.
    """
    latest = tx.execute(
        sa.select(parts.c.id, parts.c.state, parts.c.rejected)
        .where(parts.c.state.in_(_DECIDED))
        .order_by(parts.c.id.desc())
        .limit(window)
    ).all()
    if not latest:
        return ()
    counts = {
        REJECT_RATE: sum(row.rejected for row in latest),
        REVIEW_RATE: sum(row.state != PartState.ACCEPTED for row in latest),
    }
    wrong: dict[str, str] = {}  # what is raised, and why
    right: set[str] = set()
    for name, n in counts.items():
        limit = limits.get(name, 0.0)
        if limit and n > limit * window and len(latest) == window:
            wrong[name] = (
                f"{n} of the last {window} parts were {_WORDS[name]}; the limit is {100.0 * limit:g} %"
            )
        elif not limit or (len(latest) == window and n <= clear_at(limit, window) * window):
            right.add(name)
    drifting = {f"{DRIFT}:{job}" if job else DRIFT: message for job, message in drifts.items()}
    for name, message in {**drifting, **others}.items():
        if message:
            wrong[name] = message
        elif message is not None:
            right.add(name)
    stands = {alert.name: alert for alert in raised_alerts(tx)}
    made = [AlertRecord(name, latest[0].id, tx.now, cleaned(why)) for name, why in wrong.items()]
    new = [alert for alert in made if alert.name not in stands and tx.insert_if_new(alerts, alert.__dict__)]
    for alert in new:
        _send(tx, alert, "raised", targets)
    for name in right & stands.keys():
        if tx.execute(sa.delete(alerts).where(alerts.c.name == name)).rowcount:
            _send(tx, stands[name], "cleared", targets)
    return tuple(new)


def clear_at(limit: float, window: int) -> float:
    """The rate at which an alert of that limit is cleared."""
    return max(0.0, limit - _SIGMAS * math.sqrt(limit * (1.0 - limit) / window))


def _send(tx: Transaction, alert: AlertRecord, state: str, targets: Sequence[str]) -> None:
    """Both are sent as the part's that raised it, for what is of one part arrives in its order."""
    payload = {
        "alert": alert.name,
        "state": state,
        "message": alert.message,
        "part_id": alert.part_id,
        "raised_at": alert.at.isoformat(),
        "at": tx.now.isoformat(),
    }
    put_in_outbox(tx, part_by_id(tx, alert.part_id), targets, payload=payload)
