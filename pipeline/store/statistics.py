"""The dashboard's numbers, counted by the database over its indexes."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.records import PartState, Statistics, TrendStep
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError
from pipeline.store.tables import parts, readings

HOUR, DAY = timedelta(hours=1), timedelta(days=1)
_LONGEST = timedelta(days=3660)


def statistics(tx: Transaction, since: datetime, *, step: timedelta = HOUR) -> Statistics:
    """Of the parts received, and the readings made, since a time; `step` of the trend is HOUR or DAY.

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
        trend=_trend(tx, since, step),
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


def _trend(tx: Transaction, since: datetime, step: timedelta) -> tuple[TrendStep, ...]:
    begin: sa.ColumnElement[str]
    written = "%Y-%m-%d %H" if step == HOUR else "%Y-%m-%d"
    if tx.postgresql:
        utc = sa.func.timezone("UTC", parts.c.created_at)
        begin = sa.func.to_char(utc, "YYYY-MM-DD HH24" if step == HOUR else "YYYY-MM-DD")
    else:
        length = len("2026-11-21 18" if step == HOUR else "2026-11-21")
        begin = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, length)
    named = (
        sa.select(begin.label("begin"), parts.c.state, parts.c.rejected)
        .where(parts.c.created_at >= since)
        .subquery()
    )  # once, for PostgreSQL takes the same function with other parameters for another one
    state = named.c.state
    counts = {
        "parts": sa.func.count(),
        "accepted": _sum(state == PartState.ACCEPTED),
        "review": _sum(state.in_((PartState.REVIEW, PartState.REVIEWED))),
        "rejects": _sum(named.c.rejected),
    }
    asked = sa.select(named.c.begin, *(n.label(name) for name, n in counts.items()))
    counted = {
        row.begin: {name: int(getattr(row, name)) for name in counts}
        for row in tx.execute(asked.group_by(named.c.begin))
    }
    first = since.replace(minute=0, second=0, microsecond=0)
    first = first if step == HOUR else first.replace(hour=0)
    n_steps = max(0, int((tx.now - first) / step) + 1)
    steps = (first + k * step for k in range(n_steps))
    return tuple(TrendStep(at, **counted.get(at.strftime(written), {})) for at in steps)


def _sum(flag: sa.ColumnElement[bool]) -> sa.ColumnElement[int]:
    return sa.func.sum(sa.case((flag, 1), else_=0))
