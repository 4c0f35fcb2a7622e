"""Alerts, and the scans of golden parts from which some of them come.

An alert is raised once when something goes wrong, and cleared once when it is right again, across restarts.

rate of the last n parts    limit ------/----\\------------ raised above
                            clear -----/------\\------/\\--- cleared at or below; between the two nothing happens
                                   ___/        \\____/
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import sqlalchemy as sa

from pipeline.common.golden_record import GoldenMeasure, GoldenRecord, Measured
from pipeline.common.reading_records import from_json, to_json
from pipeline.common.records import AlertRecord, PartState
from pipeline.store.database import Transaction
from pipeline.store.errors import cleaned
from pipeline.store.outbox import put_in_outbox
from pipeline.store.rows import record_of
from pipeline.store.tables import alerts, golden, parts

REJECT_RATE, REVIEW_RATE, DRIFT = "reject_rate", "review_rate", "drift"
_DECIDED = (PartState.ACCEPTED, PartState.REVIEW, PartState.REVIEWED)
_WORDS = {REJECT_RATE: "rejected", REVIEW_RATE: "sent to a person"}
# standard deviations of the window by which a rate must fall below its limit to count as right again
_SIGMAS = 2.0
MOST_SCANS = 500


def raised_alerts(tx: Transaction) -> tuple[AlertRecord, ...]:
    """Alerts that are raised now, oldest first."""
    rows = tx.execute(sa.select(alerts).order_by(alerts.c.at, alerts.c.name))
    return tuple(record_of(AlertRecord, row) for row in rows)


def look_for_alerts(
    tx: Transaction,
    *,
    limits: Mapping[str, float],  # of `REJECT_RATE` and `REVIEW_RATE`; 0: none
    window: int,  # latest parts for rates; no rate alerts with fewer
    drifts: Mapping[str, str | None],  # from the certified parts, by job; empty if none, None if not known
    others: Mapping[str, str | None] = MappingProxyType({}),  # the same by the alert's name
    targets: Sequence[str] = (),
) -> tuple[AlertRecord, ...]:
    """Raise and clear alerts that are due, put them in the outbox of the targets, and return those raised now."""
    latest = tx.execute(
        sa.select(parts.c.id, parts.c.state, parts.c.rejected)
        .where(parts.c.state.in_(_DECIDED))
        .order_by(parts.c.id.desc())
        .limit(window)
    ).all()
    if not latest:
        return ()
    standing = {alert.name: alert for alert in raised_alerts(tx)}
    new: list[AlertRecord] = []

    def rate(name: str, n: int) -> str | None:
        limit = limits.get(name, 0.0)
        if not limit or (len(latest) == window and n <= _clear_at(limit, window) * window):
            return ""
        if len(latest) < window or n <= limit * window:
            return None
        return f"{n} of the last {window} parts were {_WORDS[name]}; the limit is {100.0 * limit:g} %"

    def send(alert: AlertRecord, state: str) -> None:
        # sent as a message about the part that raised it: messages about one part arrive in order
        payload = {"alert": alert.name, "state": state, "message": alert.message, "part_id": alert.part_id}
        payload |= {"raised_at": alert.at.isoformat(), "at": tx.now.isoformat()}
        put_in_outbox(tx, alert.part_id, targets, payload)

    faults = {
        REJECT_RATE: rate(REJECT_RATE, sum(row.rejected for row in latest)),
        REVIEW_RATE: rate(REVIEW_RATE, sum(row.state != PartState.ACCEPTED for row in latest)),
        **{f"{DRIFT}:{job}" if job else DRIFT: message for job, message in drifts.items()},
        **others,
    }
    for name, message in sorted(faults.items()):
        if message and name not in standing:
            alert = AlertRecord(name, latest[0].id, tx.now, cleaned(message))
            if tx.insert_if_new(alerts, vars(alert)):
                new.append(alert)
                send(alert, "raised")
        gone = sa.delete(alerts).where(alerts.c.name == name)
        if message == "" and name in standing and tx.execute(gone).rowcount:
            send(standing[name], "cleared")
    return tuple(new)


def _clear_at(limit: float, window: int) -> float:
    return max(0.0, limit - _SIGMAS * math.sqrt(limit * (1.0 - limit) / window))


def add_golden(
    tx: Transaction, measures: Mapping[GoldenMeasure, Measured], *, line: str, reference: bool
) -> GoldenRecord:
    """Store the result of a scan of a golden part; the first of a line is its reference."""
    first = tx.count(golden, golden.c.line == line) == 0
    record = GoldenRecord(tx.now, line, reference or first, dict(measures))
    row = {"line": line, "reference": record.reference, "record": to_json(record)}
    tx.execute(sa.insert(golden).values(**row))
    return record


def golden_scans(tx: Transaction, line: str, *, limit: int = MOST_SCANS) -> tuple[GoldenRecord, ...]:
    """The latest scans of a line, the newest first, and after them their reference."""
    of_line = sa.select(golden).where(golden.c.line == line).order_by(golden.c.id.desc())
    rows = list(tx.execute(of_line.limit(limit)))
    if not any(row.reference for row in rows):
        rows += tx.execute(of_line.where(golden.c.reference).limit(1))
    return tuple(from_json(GoldenRecord, row.record) for row in rows)
