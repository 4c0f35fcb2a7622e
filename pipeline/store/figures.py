"""The dashboard's numbers, counted by the database over its indexes."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, date, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.records import Agreement, AgreementDay, PartState, Statistics, TrendStep
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError
from pipeline.store.rows import READ
from pipeline.store.tables import events, parts

HOUR, DAY = timedelta(hours=1), timedelta(days=1)
_LONGEST = timedelta(days=3660)
_Counted = dict[str, sa.ColumnElement[int]]
_WRITTEN = {HOUR: "%Y-%m-%d %H", DAY: "%Y-%m-%d"}


def statistics(tx: Transaction, since: datetime, *, step: timedelta = HOUR) -> Statistics:
    """Figures of the parts received, and the readings made, since a time; `step` of the trend is HOUR or DAY.

    Raises:
        UnfitError: the time has no zone, or is more than ten years ago.
    """
    if since.tzinfo is None or tx.now - since > _LONGEST:
        raise UnfitError("statistics cannot begin there", hint="give a time with its zone, not ten years ago")
    since, n = since.astimezone(UTC), sa.func.count()
    counted: _Counted = {
        "parts": n,
        "by_camera": n.filter(parts.c.by_camera),
        "fell_back": n.filter(parts.c.fell_back),
        "rejects": n.filter(parts.c.rejected),
        "reviewed": n.filter(parts.c.was_right.is_not(None)),
        "right_before_review": n.filter(parts.c.was_right),
        "characters_reviewed": sa.func.coalesce(sa.func.sum(parts.c.characters), 0),
        "characters_right": sa.func.coalesce(sa.func.sum(parts.c.characters_right), 0),
        **{_of(state): n.filter(parts.c.state == state) for state in PartState},
    }
    rows = {row["begin"]: row for row in _by_step(tx, step, counted, parts.c.created_at >= since)}
    total = {name: sum(row[name] for row in rows.values()) for name in counted}
    by_state = {state: total.pop(_of(state)) for state in PartState}
    nothing, first = dict.fromkeys(counted, 0), since.replace(minute=0, second=0, microsecond=0)
    first = first if step == HOUR else first.replace(hour=0)
    steps = (first + k * step for k in range(max(0, int((tx.now - first) / step) + 1)))
    return Statistics(
        since=since,
        **total,
        by_state={state: n for state, n in by_state.items() if n},
        seconds=_seconds(tx, since),
        trend=tuple(_trend_step(at, rows.get(at.strftime(_WRITTEN[step]), nothing)) for at in steps),
        awaiting=tx.count(parts, parts.c.state == PartState.REVIEW),
    )


def agreement_by_day(tx: Transaction, since: datetime) -> tuple[AgreementDay, ...]:
    """Agreement with the line's own reader by day, of parts received in shadow mode since a time.

    Days without any are left out.

    Raises:
        UnfitError: the time has no zone.
    """
    if since.tzinfo is None:
        raise UnfitError("agreement cannot begin there", hint="give a time with its zone")
    kind, n = parts.c.agreement, sa.func.count()
    would = sa.and_(parts.c.would_be == PartState.ACCEPTED, kind != Agreement.ALONE)
    counted: _Counted = {
        "parts": n,
        "compared": n.filter(kind != Agreement.ALONE),
        **{one.value: n.filter(kind == one) for one in (Agreement.SAME, Agreement.OTHER, Agreement.NOTHING)},
        "accepted": n.filter(would),
        "accepted_other": n.filter(would, kind != Agreement.SAME),
    }
    in_shadow = sa.and_(kind.in_(list(Agreement)), parts.c.created_at >= since)
    days = _by_step(tx, DAY, counted, in_shadow)
    return tuple(AgreementDay(date.fromisoformat(day.pop("begin")), **day) for day in days)


def _by_step(
    tx: Transaction, step: timedelta, counted: _Counted, where: sa.ColumnElement[bool]
) -> list[dict[str, Any]]:
    """Counts of parts in each time step that has any, by its `begin`, in order."""
    begin: sa.ColumnElement[str]
    if tx.postgresql:
        utc = sa.func.timezone("UTC", parts.c.created_at)
        begin = sa.func.to_char(utc, "YYYY-MM-DD HH24" if step == HOUR else "YYYY-MM-DD")
    else:
        begin = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, 13 if step == HOUR else 10)
    columns = (what.label(sa.quoted_name(name, quote=True)) for name, what in counted.items())
    # by its place, for PostgreSQL takes the same function with other parameters for another one
    place: sa.ColumnElement[str] = sa.literal_column("1")
    asked = sa.select(begin.label("begin"), *columns).where(where).group_by(place).order_by(place)
    return [dict(row) for row in tx.execute(asked).mappings()]


def _of(state: PartState) -> str:
    """Name of the number of parts in a state."""
    return f"in {state}"


def _seconds(tx: Transaction, since: datetime) -> Mapping[str, tuple[float, float]]:
    import numpy as np

    # counted by the millisecond, which is several times quicker than to sort them
    ms = sa.func.round(events.c.seconds * 1000.0).label("ms")
    read = sa.select(events.c.actor, ms).where(events.c.kind == READ, events.c.at >= since).subquery()
    kinds = (read.c.actor, read.c.ms)
    found: dict[str, dict[float, int]] = {}
    for source, took_ms, n in tx.execute(sa.select(*kinds, sa.func.count()).group_by(*kinds)):
        found.setdefault(source, {})[took_ms / 1000.0] = n
    ranks = {
        source: np.quantile(list(counts), (0.5, 0.99), weights=list(counts.values()), method="inverted_cdf")
        for source, counts in sorted(found.items())
    }
    return {source: (float(p50), float(p99)) for source, (p50, p99) in ranks.items()}


def _trend_step(at: datetime, row: Mapping[str, int]) -> TrendStep:
    review = row[_of(PartState.REVIEW)] + row[_of(PartState.REVIEWED)]
    return TrendStep(at, row["parts"], row[_of(PartState.ACCEPTED)], review, row["rejects"])
