"""Parts that wait for touch: whom the stage is to feel, and who has waited for too long.

touch_needed --felt, or a scan is sent-----> accepted, review     (`parts.add_readings`)
             \\-nobody has, until its time--> review               (`give_up_touch`)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import sqlalchemy as sa

from pipeline.common.records import PartRecord, PartState
from pipeline.store.database import Transaction
from pipeline.store.errors import MAX_ROWS, ConflictError, fit_limit
from pipeline.store.lists import listed
from pipeline.store.outbox import put_in_outbox
from pipeline.store.parts import add_events, lock_part, text_columns
from pipeline.store.rows import part_by_id, select_parts
from pipeline.store.tables import parts

_WAITS = parts.c.state == PartState.TOUCH_NEEDED


def waiting_for_stage(tx: Transaction, line: str, *, limit: int = 100) -> tuple[PartRecord, ...]:
    """Parts of a line that its stage is to feel, oldest first."""
    of_line = sa.func.coalesce(parts.c.line, "") == line
    query = select_parts().where(_WAITS, parts.c.touch_by_stage.is_(True), of_line)
    return listed(tx, query.order_by(parts.c.id).limit(fit_limit(limit)))


@dataclass(frozen=True)
class Waiting:
    """A part that waits for touch.

    Attributes:
        part_id: of the part.
        changed_at: when anything last happened to it.
        until: when its time is up; None where no time was set.
    """

    part_id: str
    changed_at: datetime
    until: datetime | None


def waiting_for_touch(tx: Transaction, *, limit: int = MAX_ROWS) -> tuple[Waiting, ...]:
    """All parts that wait for touch, whoever is to feel them, oldest first."""
    asked = sa.select(parts.c.id, parts.c.changed_at, parts.c.touch_until).where(_WAITS)
    rows = tx.execute(asked.order_by(parts.c.id).limit(fit_limit(limit)))
    return tuple(Waiting(row.id, row.changed_at, row.touch_until) for row in rows)


def ask_for_touch(tx: Transaction, part_id: str, *, line: str, until: datetime) -> PartRecord:
    """Have the stage of a line feel a part that waits for touch, whoever was to.

    Raises:
        ConflictError: it does not wait for touch.
    """
    _lock_waiting(tx, part_id)
    asked = {"touch_by_stage": True, "touch_until": until, "line": line}
    tx.execute(sa.update(parts).where(parts.c.id == part_id).values(**asked))
    return part_by_id(tx, part_id)


def give_up_touch(tx: Transaction, part_id: str, *, why: str, targets: Sequence[str] = ()) -> PartRecord:
    """Leave a part to a person, for nobody has felt it; it keeps its plan, and a scan may still be sent.

    Raises:
        ConflictError: it does not wait for touch.
    """
    part = _lock_waiting(tx, part_id)
    changes = {"state": PartState.REVIEW, "changed_at": tx.now}
    if part.reading is not None:
        changes |= text_columns(part.reading.text)
    tx.execute(sa.update(parts).where(parts.c.id == part_id).values(**changes))
    add_events(tx, part_id, [("not_felt", {"why": why})])
    given_up = part_by_id(tx, part_id)
    put_in_outbox(tx, given_up, targets)
    return given_up


def _lock_waiting(tx: Transaction, part_id: str) -> PartRecord:
    lock_part(tx, part_id)
    part = part_by_id(tx, part_id)
    if part.state is not PartState.TOUCH_NEEDED:
        raise ConflictError(
            f"the part {part_id} does not wait for touch; it is {part.state.value}", hint="look at it again"
        )
    return part
