"""The dashboard's numbers, counted by the database over its indexes."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.records import PartState, Statistics
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError
from pipeline.store.tables import parts, readings

_HOUR = timedelta(hours=1)
_LONGEST = timedelta(days=3660)


def statistics(tx: Transaction, since: datetime) -> Statistics:
    """Of the parts received, and the readings made, since a time.

    Raises:
        UnfitError: the time has no zone, or is more than ten years ago.
    """
    if since.tzinfo is None or tx.now - since > _LONGEST:
        raise UnfitError(
            "statistics cannot begin there", hint="give a time with its zone, within the last ten years"
        )
    since = since.astimezone(UTC)
    row = tx.execute(_counts(since)).one()._mapping
    total = {name: int(value or 0) for name, value in row.items()}
    awaiting = sa.select(sa.func.count()).select_from(parts).where(parts.c.state == PartState.REVIEW)
    return Statistics(
        since=since,
        parts=total["n"],
        by_camera=total["by_camera"],
        fell_back=total["fell_back"],
        by_state={state: total[state.value] for state in PartState if total[state.value]},
        rejects=total["rejected"],
        reviewed=total["n_reviewed"],
        right_before_review=total["was_right"],
        characters_reviewed=total["characters"],
        characters_right=total["characters_right"],
        seconds=_seconds(tx, since),
        per_hour=_per_hour(tx, since),
        awaiting=tx.execute(awaiting).scalar_one(),
    )


def _counts(since: datetime) -> sa.Select[Any]:
    flags = ("by_camera", "fell_back", "rejected", "was_right")
    # one row, not one for each state: SQLite would group by the index of the states, over all time
    columns: list[sa.ColumnElement[Any]] = [
        sa.func.count().label("n"),
        # was_right is known of every part that was reviewed, and of no other
        sa.func.count(parts.c.was_right).label("n_reviewed"),
        *(sa.func.sum(sa.cast(parts.c[flag], sa.Integer)).label(flag) for flag in flags),
        *(sa.func.sum(parts.c[name]).label(name) for name in ("characters", "characters_right")),
        *(sa.func.sum(sa.case((parts.c.state == s, 1), else_=0)).label(s.value) for s in PartState),
    ]
    return sa.select(*columns).where(parts.c.created_at >= since)


def _seconds(tx: Transaction, since: datetime) -> Mapping[str, tuple[float, float]]:
    # counted by the millisecond, which is several times quicker than to sort them
    counted = (
        sa.select(readings.c.source, sa.func.round(readings.c.seconds * 1000.0).label("ms"))
        .where(readings.c.at >= since)
        .subquery()
    )
    rows = tx.execute(
        sa.select(counted.c.source, counted.c.ms, sa.func.count().label("n")).group_by(
            counted.c.source, counted.c.ms
        )
    )
    found: dict[str, dict[float, int]] = {}
    for row in rows:
        found.setdefault(row.source, {})[row.ms / 1000.0] = row.n
    return {
        source: (_nearest_rank(found[source], 50), _nearest_rank(found[source], 99))
        for source in sorted(found)
    }


def _nearest_rank(counts: Mapping[float, int], percent: int) -> float:
    """The least value that at least so many percent of all do not exceed."""
    wanted = -(-percent * sum(counts.values()) // 100)
    passed = 0
    for value in sorted(counts):
        passed += counts[value]
        if passed >= wanted:
            return value
    raise AssertionError("no values")


def _per_hour(tx: Transaction, since: datetime) -> tuple[tuple[datetime, int], ...]:
    hour: sa.ColumnElement[str]
    if tx.postgresql:
        utc = sa.func.timezone("UTC", parts.c.created_at)
        hour = sa.func.to_char(sa.func.date_trunc("hour", utc), "YYYY-MM-DD HH24")
    else:
        hour = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, len("2026-11-21 18"))
    named = (
        sa.select(hour.label("hour")).where(parts.c.created_at >= since).subquery()
    )  # once, for PostgreSQL takes the same function with other parameters for another one
    counted = {
        row.hour: row.n
        for row in tx.execute(sa.select(named.c.hour, sa.func.count().label("n")).group_by(named.c.hour))
    }
    first = since.replace(minute=0, second=0, microsecond=0)
    n_hours = max(0, int((tx.now - first) / _HOUR) + 1)
    hours = (first + k * _HOUR for k in range(n_hours))
    return tuple((h, counted.get(h.strftime("%Y-%m-%d %H"), 0)) for h in hours)
