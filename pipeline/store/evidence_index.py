"""Which files the store still counts on."""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from pipeline.common.records import EvidenceRecord
from pipeline.store.errors import fit_limit
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import evidence_of
from pipeline.store.tables import evidence, parts


def evidence_before(
    connection: Connection, when: datetime, *, limit: int
) -> tuple[tuple[str, EvidenceRecord], ...]:
    """(part id, evidence) from before a time that is still kept, oldest first."""
    rows = connection.execute(
        sa.select(evidence)
        .where(evidence.c.gone.is_(False), evidence.c.at < when)
        .order_by(evidence.c.at, evidence.c.id)
        .limit(fit_limit(limit))
    )
    return tuple((row.part_id, evidence_of(row)) for row in rows)


def evidence_gone(connection: Connection, now: datetime, part_id: str, sha256: str) -> bool:
    """Note that a part's file is no longer kept, and say whether nothing else needs the file."""
    lock_part(connection, part_id)
    mine = sa.and_(evidence.c.part_id == part_id, evidence.c.sha256 == sha256, evidence.c.gone.is_(False))
    kinds = sorted(set(connection.execute(sa.select(evidence.c.kind).where(mine)).scalars()))
    if kinds:
        connection.execute(sa.update(evidence).where(mine).values(gone=True))
        add_events(connection, now, part_id, [("evidence_expired", {"sha256": sha256, "kinds": kinds})])
        connection.execute(sa.update(parts).where(parts.c.id == part_id).values(changed_at=now))
    needed = sa.select(evidence.c.id).where(evidence.c.sha256 == sha256, evidence.c.gone.is_(False)).limit(1)
    return connection.execute(needed).one_or_none() is None


def known_hashes(connection: Connection) -> frozenset[str]:
    """Hashes of every file that is still needed."""
    rows = connection.execute(sa.select(evidence.c.sha256).where(evidence.c.gone.is_(False)).distinct())
    return frozenset(rows.scalars())
