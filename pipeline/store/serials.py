"""Duplicate and sequence checks of serials against the parts in the store.

Rules are checked in the transaction that writes the part. SQLite has one writer at a time; on PostgreSQL the check
takes a lock of its own until its transaction ends, so that of two services one is first with a serial.
"""

from __future__ import annotations

import sqlalchemy as sa

from pipeline.common.records import PartRecord, PartState
from pipeline.common.serial_rules import WINDOW, Objection, SerialAlarm, SerialRules
from pipeline.store.database import Transaction
from pipeline.store.tables import parts

_LOCK = 0x5E81A1
# parts among which those are looked for that were read surely
_LOOKED_BACK = 4 * WINDOW
_BEARS = (PartState.ACCEPTED, PartState.REVIEWED)
_NAME, _TEXT = parts.c.record["name"].as_string(), parts.c.record["text"].as_string()
_READ, _DECISION = (parts.c.record["reading", name].as_string() for name in ("text", "decision"))


def ask_alone(tx: Transaction, rules: SerialRules) -> None:
    """Keep others that ask out until the transaction ends, if there are rules to check; to be called before a part is
    locked, or two may wait for each other."""
    if rules.any and tx.postgresql:
        tx.execute(sa.select(sa.func.pg_advisory_xact_lock(_LOCK)))


def objections(tx: Transaction, rules: SerialRules, part: PartRecord) -> tuple[Objection, ...]:
    """Objections to the serial of a part that was read with certainty.

    Args:
        tx: the transaction that writes the part.
        rules: rules to check.
        part: the part with its serial; a part read again under the same name is not a duplicate.
    """
    found = [rules.by_order(part.text)]
    if rules.duplicates:
        found.append(_read_before(tx, part))
    if rules.jump:
        found.append(rules.by_place(part.text, _before(tx, part)))
    return tuple(one for one in found if one is not None)


def _read_before(tx: Transaction, part: PartRecord) -> Objection | None:
    bears = sa.select(parts.c.id, _NAME.label("name"), _TEXT.label("text")).where(
        parts.c.text_folded == part.text.casefold(), parts.c.state.in_(_BEARS), parts.c.id != part.id
    )
    for row in tx.execute(bears.order_by(parts.c.id.desc()).limit(WINDOW)):
        if row.text == part.text and not (part.name and row.name == part.name):
            of = row.name if row.name else f"the part {row.id}"
            return Objection(SerialAlarm.READ_BEFORE, f"{part.text} was read before, of {of}", row.id)
    return None


def _before(tx: Transaction, part: PartRecord) -> list[tuple[int, str]]:
    """(how many parts before, serial) of the latest parts of a line and job that were read surely."""
    query = (
        sa.select(parts.c.state, _TEXT.label("text"), _READ.label("read"), _DECISION.label("decision"))
        .where(parts.c.id < part.id, parts.c.state != PartState.SHADOW)
        .where(parts.c.line == part.line, parts.c.job == part.job)
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
