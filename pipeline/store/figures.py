"""The dashboard's numbers, counted by the database over its indexes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
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
_WRITTEN = {HOUR: "%Y-%m-%d %H", DAY: "%Y-%m-%d"}


def statistics(tx: Transaction, since: datetime, *, step: timedelta = HOUR) -> Statistics:
    """Figures of the parts received, and the readings made, since a time; `step` of the trend is HOUR or DAY.

    Raises:
        UnfitError: the time has no zone, or is more than ten years ago.
    """
    if since.tzinfo is None or tx.now - since > _LONGEST:
        raise UnfitError("statistics cannot begin there", hint="give a time with its zone, not ten years ago")
    since = since.astimezone(UTC)
    names = ("state", "by_camera", "fell_back", "rejected", "was_right")
    lengths = [sa.func.sum(parts.c[name]).label(name) for name in ("characters", "characters_right")]
    rows = _counted(tx, step, *names, where=parts.c.created_at >= since, sums=lengths)

    def total(**wanted: object) -> int:
        return sum(r.n for r in rows if all(getattr(r, name) == value for name, value in wanted.items()))

    by_state = {state: total(state=state) for state in PartState}
    return Statistics(
        since=since,
        parts=total(),
        by_camera=total(by_camera=True),
        fell_back=total(fell_back=True),
        by_state={state: n for state, n in by_state.items() if n},
        rejects=total(rejected=True),
        reviewed=total() - total(was_right=None),
        right_before_review=total(was_right=True),
        characters_reviewed=sum(row.characters or 0 for row in rows),
        characters_right=sum(row.characters_right or 0 for row in rows),
        seconds=_seconds(tx, since),
        trend=_trend(rows, since, tx.now, step),
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
    compared = sa.and_(parts.c.agreement.in_(list(Agreement)), parts.c.created_at >= since)
    days: dict[str, tuple[dict[Agreement, int], dict[Agreement, int]]] = {}
    for row in _counted(tx, DAY, "agreement", "would_be", where=compared):
        accepted, of_all = days.setdefault(row.begin, ({}, {}))
        kind = Agreement(row.agreement)
        of_all[kind] = of_all.get(kind, 0) + row.n
        if row.would_be == PartState.ACCEPTED:
            accepted[kind] = row.n
    return tuple(AgreementDay(date.fromisoformat(day), *days[day]) for day in sorted(days))


def _counted(
    tx: Transaction, step: timedelta, *names: str, where: sa.ColumnElement[bool], sums: Any = ()
) -> list[Any]:
    """Number of parts (n) for each value of these columns and each time step (begin)."""
    begin: sa.ColumnElement[str]
    if tx.postgresql:
        utc = sa.func.timezone("UTC", parts.c.created_at)
        begin = sa.func.to_char(utc, "YYYY-MM-DD HH24" if step == HOUR else "YYYY-MM-DD")
    else:
        begin = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, 13 if step == HOUR else 10)
    columns = [begin.label("begin"), *(parts.c[name] for name in names)]
    # by their place, for PostgreSQL takes the same function with other parameters for another one
    places: list[sa.ColumnElement[Any]] = [sa.literal_column(str(k + 1)) for k in range(len(columns))]
    asked = sa.select(*columns, sa.func.count().label("n"), *sums).where(where).group_by(*places)
    return list(tx.execute(asked))


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


def _trend(rows: list[Any], since: datetime, now: datetime, step: timedelta) -> tuple[TrendStep, ...]:
    first = since.replace(minute=0, second=0, microsecond=0)
    first = first if step == HOUR else first.replace(hour=0)
    steps = {
        at.strftime(_WRITTEN[step]): TrendStep(at)
        for at in (first + k * step for k in range(max(0, int((now - first) / step) + 1)))
    }
    for row in rows:
        if (so_far := steps.get(row.begin)) is not None:
            steps[row.begin] = replace(
                so_far,
                parts=so_far.parts + row.n,
                accepted=so_far.accepted + row.n * (row.state == PartState.ACCEPTED),
                review=so_far.review + row.n * (row.state in (PartState.REVIEW, PartState.REVIEWED)),
                rejects=so_far.rejects + row.n * bool(row.rejected),
            )
    return tuple(steps.values())
