"""Which files the store still counts on."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime

import sqlalchemy as sa

from pipeline.common.records import EvidenceRecord
from pipeline.store.database import Transaction
from pipeline.store.errors import fit_limit
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import evidence_record
from pipeline.store.tables import evidence, parts


def evidence_before(
    tx: Transaction, when: datetime, limit: int = 200
) -> tuple[tuple[str, EvidenceRecord], ...]:
    """(part id, file) of files from before a time that are still kept, oldest first."""
    rows = tx.execute(
        sa.select(evidence)
        .where(evidence.c.gone.is_(False), evidence.c.at < when)
        .order_by(evidence.c.at, evidence.c.id)
        .limit(fit_limit(limit))
    )
    return tuple((row.part_id, evidence_record(row)) for row in rows)


def evidence_gone(tx: Transaction, part_id: str, sha256: str) -> bool:
    """Note that a part's file is no longer kept; True if no part needs that file any more."""
    lock_part(tx, part_id)
    mine = sa.and_(evidence.c.part_id == part_id, evidence.c.sha256 == sha256, evidence.c.gone.is_(False))
    kinds = sorted(set(tx.execute(sa.select(evidence.c.kind).where(mine)).scalars()))
    if kinds:
        tx.execute(sa.update(evidence).where(mine).values(gone=True))
        add_events(tx, part_id, [("evidence_expired", {"sha256": sha256, "kinds": kinds})])
        tx.execute(sa.update(parts).where(parts.c.id == part_id).values(changed_at=tx.now))
    needed = sa.select(evidence.c.id).where(evidence.c.sha256 == sha256, evidence.c.gone.is_(False)).limit(1)
    return tx.execute(needed).one_or_none() is None


def needed_hashes(tx: Transaction, hashes: Collection[str]) -> frozenset[str]:
    """Which of the files of these hashes are still needed."""
    asked = sa.select(evidence.c.sha256).where(
        evidence.c.sha256.in_(list(hashes)), evidence.c.gone.is_(False)
    )
    return frozenset(tx.execute(asked.distinct()).scalars())


def needed_after(tx: Transaction, after: str = "", *, limit: int = 500) -> tuple[str, ...]:
    """Hashes of files that are still needed, in order, from one on."""
    asked = sa.select(evidence.c.sha256).where(evidence.c.sha256 > after, evidence.c.gone.is_(False))
    return tuple(tx.execute(asked.distinct().order_by(evidence.c.sha256).limit(fit_limit(limit))).scalars())


def forget_files(tx: Transaction, hashes: Collection[str]) -> None:
    """In the copy of a store: note that files are gone whose time was up as they were to be copied."""
    tx.execute(sa.update(evidence).where(evidence.c.sha256.in_(list(hashes))).values(gone=True))
