"""Lists of parts, queues of reviews and audits, and the dashboard's numbers, which the database counts."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, date, datetime, timedelta
from typing import Any

import sqlalchemy as sa

from pipeline.common.names import folded
from pipeline.common.part_id import is_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import Agreement, AgreementDay, PartRecord, PartState, Statistics, TrendStep
from pipeline.store.database import Transaction
from pipeline.store.errors import NotFoundError, UnfitError, fit
from pipeline.store.review import IS_AUDITED, claimed_by_another, has_opinion_of
from pipeline.store.rows import READ, select_parts
from pipeline.store.tables import events, parts

_IDS = sa.select(parts.c.id)
HOUR, DAY = timedelta(hours=1), timedelta(days=1)
_LONGEST = timedelta(days=3660)
_Counted = dict[str, sa.ColumnElement[int]]
_WRITTEN = {HOUR: "%Y-%m-%d %H", DAY: "%Y-%m-%d"}


def latest_named(tx: Transaction, name: str) -> PartRecord:
    """The latest part of a name, however it is spelled."""
    same = parts.c.name_folded == folded(fit(name, "the name"))
    wanted = _IDS.where(same).order_by(parts.c.id.desc()).limit(1)
    for part in select_parts(tx, wanted):
        return part
    raise NotFoundError(f"there is no part named {name!r}", hint="check the name")


def find_parts(
    tx: Transaction,
    *,
    state: PartState | None = None,
    agreement: Agreement | None = None,  # with the line's own reader, of parts read in shadow mode
    would_be: PartState | None = None,  # their state outside shadow mode
    text: str = "",
    name: str = "",
    whole_name: bool = False,  # the name is the whole one
    job: str = "",
    line: str = "",
    since: datetime | None = None,
    until: datetime | None = None,
    before: str | None = None,
    limit: int = 50,
) -> tuple[PartRecord, ...]:
    """Parts, newest first, before the part with the id `before`; they contain `text` and `name` in either case."""
    same = {"state": state, "agreement": agreement, "would_be": would_be, "job": job, "line": line}
    wanted = [parts.c[column] == fit(value, "what is sought") for column, value in same.items() if value]
    # not LIKE: nothing in what is sought has a meaning of its own
    find = sa.func.strpos if tx.postgresql else sa.func.instr
    wanted += [
        find(parts.c[f"{column}_folded"], fold(fit(value, "what is sought"))) > 0
        for column, value, fold in (("text", text, str.casefold), ("name", name, folded))
        if value
    ]
    if whole_name:
        wanted.append(parts.c.name_folded == folded(fit(name, "what is sought")))
    # not `created_at` alone: by its index the database would sort all matches for every page, instead of using the ids
    received = sa.func.coalesce(parts.c.created_at, parts.c.created_at)
    if since is not None:
        wanted.append(received >= since)
    if until is not None:
        wanted.append(received < until)
    if before is not None:
        wanted.append(parts.c.id < _page_end(before))
    ids = _IDS.where(*wanted).order_by(parts.c.id.desc()).limit(limit)
    return select_parts(tx, ids, newest_first=True)


def queue(tx: Transaction, *, audits: bool = False, limit: int = 50) -> tuple[PartRecord, ...]:
    """Parts that a person should review or audit, oldest first."""
    return select_parts(tx, _IDS.where(_awaits(audits)).order_by(parts.c.id).limit(limit))


def queue_length(tx: Transaction, *, audits: bool = False) -> int:
    """Number of parts that a person should review or audit."""
    return tx.count(parts, _awaits(audits))


def next_in_queue(
    tx: Transaction, after: str | None = None, *, person: Person | None = None, audits: bool = False
) -> PartRecord | None:
    """The oldest part to review, or to audit, after that one, otherwise the oldest, otherwise None. Parts that another
    reader has open, or that need another reader than `person`, are skipped."""
    free = _IDS.where(_awaits(audits)).order_by(parts.c.id).limit(1)
    if person is not None:
        free = free.where(
            ~sa.func.coalesce(claimed_by_another(tx, person), sa.false()), ~has_opinion_of(person)
        )
    later = () if after is None else select_parts(tx, free.where(parts.c.id > _page_end(after)))
    return next(iter(later or select_parts(tx, free)), None)


def _page_end(part_id: str) -> str:
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is not a part's id", hint="give the last page's last one")
    return part_id


def _awaits(audits: bool) -> sa.ColumnElement[bool]:
    return IS_AUDITED if audits else parts.c.state == PartState.REVIEW


def statistics(tx: Transaction, since: datetime, *, step: timedelta = HOUR) -> Statistics:
    """Figures since a time, with a trend by HOUR or DAY. Raises UnfitError: no zone, or over ten years ago."""
    if since.tzinfo is None or tx.now - since > _LONGEST:
        raise UnfitError("statistics cannot begin there", hint="give a time with its zone, not ten years ago")
    since, n = since.astimezone(UTC), sa.func.count()
    counted: _Counted = {
        "parts": n,
        "by_camera": n.filter(parts.c.by_camera),
        "fell_back": n.filter(parts.c.fell_back),
        "rejects": n.filter(parts.c.rejected, parts.c.state != PartState.TOUCH_NEEDED),
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
        trend=tuple(_trend_step(begin, rows.get(begin.strftime(_WRITTEN[step]), nothing)) for begin in steps),
        awaiting=tx.count(parts, parts.c.state == PartState.REVIEW),
    )


def agreement_by_day(tx: Transaction, since: datetime) -> tuple[AgreementDay, ...]:
    """Agreement with the line's own reader by day, in shadow mode, since a time. Raises UnfitError: it has no zone."""
    if since.tzinfo is None:
        raise UnfitError("agreement cannot begin there", hint="give a time with its zone")
    kind, n = parts.c.agreement, sa.func.count()
    would = sa.and_(parts.c.would_be == PartState.ACCEPTED, kind != Agreement.ALONE)
    counted: _Counted = {
        "parts": n,
        "compared": n.filter(kind != Agreement.ALONE),
        **{
            value.value: n.filter(kind == value)
            for value in (Agreement.SAME, Agreement.OTHER, Agreement.NOTHING)
        },
        "accepted": n.filter(would),
        "accepted_other": n.filter(would, kind != Agreement.SAME),
    }
    in_shadow = sa.and_(kind.in_(list(Agreement)), parts.c.created_at >= since)
    days = _by_step(tx, DAY, counted, in_shadow)
    return tuple(AgreementDay(date.fromisoformat(day.pop("begin")), **day) for day in days)


def _by_step(
    tx: Transaction, step: timedelta, counted: _Counted, where: sa.ColumnElement[bool]
) -> list[dict[str, Any]]:
    begin: sa.ColumnElement[str]
    if tx.postgresql:
        utc = sa.func.timezone("UTC", parts.c.created_at)
        begin = sa.func.to_char(utc, "YYYY-MM-DD HH24" if step == HOUR else "YYYY-MM-DD")
    else:
        begin = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, 13 if step == HOUR else 10)
    columns = (what.label(sa.quoted_name(name, quote=True)) for name, what in counted.items())
    # by position, because PostgreSQL regards the same function with other parameters as another expression
    place: sa.ColumnElement[str] = sa.literal_column("1")
    query = sa.select(begin.label("begin"), *columns).where(where).group_by(place).order_by(place)
    return [dict(row) for row in tx.execute(query).mappings()]


def _of(state: PartState) -> str:
    return f"in {state}"


def _seconds(tx: Transaction, since: datetime) -> Mapping[str, tuple[float, float]]:
    import numpy as np

    # counted by millisecond, which is several times faster than sorting them
    ms = sa.func.round(events.c.seconds * 1000.0).label("ms")
    read = sa.select(events.c.actor, ms).where(events.c.kind == READ, events.c.at >= since).subquery()
    kinds = (read.c.actor, read.c.ms)
    times: dict[str, dict[float, int]] = {}
    for source, took_ms, n in tx.execute(sa.select(*kinds, sa.func.count()).group_by(*kinds)):
        times.setdefault(source, {})[took_ms / 1000.0] = n
    ranks = {
        source: np.quantile(list(counts), (0.5, 0.99), weights=list(counts.values()), method="inverted_cdf")
        for source, counts in sorted(times.items())
    }
    return {source: (float(p50), float(p99)) for source, (p50, p99) in ranks.items()}


def _trend_step(begin: datetime, row: Mapping[str, int]) -> TrendStep:
    review = row[_of(PartState.REVIEW)] + row[_of(PartState.REVIEWED)]
    return TrendStep(begin, row["parts"], row[_of(PartState.ACCEPTED)], review, row["rejects"])
