"""Serials of parts in the store: who bears one already, and which came before.

Rules are asked in the transaction that writes the part. SQLite has one writer at a time; on PostgreSQL the asking takes
a lock of its own until its transaction ends, so that of two services one is first with a serial.
"""

from __future__ import annotations

from dataclasses import replace

import sqlalchemy as sa

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.common.serial_rules import WINDOW, Objection, SerialAlarm, SerialRules
from pipeline.store.database import Transaction
from pipeline.store.tables import parts, readings

_LOCK = 0x5E81A1
_LOOKED_BACK = 4 * WINDOW
"""Parts among which those are looked for that were read surely."""
_BEARS = (PartState.ACCEPTED, PartState.REVIEWED)


def ask_alone(tx: Transaction) -> None:
    """Keep other askers out until the transaction ends; to be called before a part is locked, or two may wait for each
    other."""
    if tx.postgresql:
        tx.execute(sa.select(sa.func.pg_advisory_xact_lock(_LOCK)))


def objections(
    tx: Transaction, rules: SerialRules, part_id: str, text: str, *, name: str, line: str, job: str
) -> tuple[Objection, ...]:
    """What speaks against the serial of a part that is read surely.

    Args:
        tx: the transaction that writes it.
        rules: what is asked.
        part_id: of the part.
        text: its serial.
        name: what the line calls it; a part that is read again under its name is no second one.
        line: that it comes from.
        job: that it was read by.
    """
    found = [rules.by_order(text)]
    if rules.duplicates:
        found.append(_read_before(tx, part_id, text, name))
    if rules.jump:
        found.append(rules.by_place(text, _before(tx, part_id, line, job)))
    return tuple(one for one in found if one is not None)


def with_objections(reading: ReadingRecord, against: tuple[Objection, ...]) -> ReadingRecord:
    """The reading with what speaks against its serial among its messages."""
    return replace(reading, messages=(*reading.messages, *(one.why for one in against)))


def _read_before(tx: Transaction, part_id: str, text: str, name: str) -> Objection | None:
    bears = sa.select(parts.c.id, parts.c.name, parts.c.text).where(
        parts.c.text_folded == text.casefold(), parts.c.state.in_(_BEARS), parts.c.id != part_id
    )
    for row in tx.execute(bears.order_by(parts.c.id.desc()).limit(WINDOW)):
        if row.text == text and not (name and row.name == name):
            of = row.name if row.name else f"the part {row.id}"
            return Objection(SerialAlarm.READ_BEFORE, f"{text} was read before, of {of}", row.id)
    return None


def _before(tx: Transaction, part_id: str, line: str, job: str) -> list[tuple[int, str]]:
    """(how many parts before, serial) of the latest parts of a line and job that were read surely."""
    same = (sa.func.coalesce(parts.c.line, "") == line, sa.func.coalesce(parts.c.job, "") == job)
    query = (
        sa.select(parts.c.state, parts.c.text, readings.c.decision, readings.c.text.label("read"))
        .select_from(parts.outerjoin(readings, parts.c.reading_id == readings.c.id))
        .where(parts.c.id < part_id, parts.c.state != PartState.SHADOW, *same)
        .order_by(parts.c.id.desc())
        .limit(_LOOKED_BACK)
    )
    found = []
    for back, row in enumerate(tx.execute(query), start=1):
        if row.state == PartState.REVIEWED and row.text:
            found.append((back, row.text))
        elif row.decision == "accept":
            found.append((back, row.read))
    return found
