"""Whose turn it is to send a result, and what has happened to a part sealed by hashes.

Revision ID: 0005
Revises: 0004
Create Date: 2026-11-23
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import groupby
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

ROW = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")
TIME = sa.DateTime(timezone=True)
SEALED: dict[str, dict[str, sa.types.TypeEngine[Any]]] = {
    "readings": {
        "at": TIME, "source": sa.Text(), "text": sa.Text(), "decision": sa.Text(), "confidence": sa.Double(),
        "seconds": sa.Double(), "record": sa.JSON(),
    },
    "reviews": {
        "at": TIME, "action": sa.Text(), "before": sa.Text(), "after": sa.Text(), "who": sa.Text(),
        "token": sa.Text(), "note": sa.Text(),
    },
    "evidence": {
        "at": TIME, "kind": sa.Text(), "sha256": sa.Text(), "n_bytes": sa.BigInteger(), "name": sa.Text(),
        "media_type": sa.Text(), "meta": sa.JSON(),
    },
    "events": {"at": TIME, "kind": sa.Text(), "data": sa.JSON()},
}  # fmt: skip
PAGE = 500


def upgrade() -> None:
    """No result is being sent; parts of before are sealed as they are found."""
    op.add_column("outbox", sa.Column("owner", sa.String(32), nullable=True))
    op.add_column("outbox", sa.Column("leased_until", TIME, nullable=True))
    op.drop_index("ix_outbox_due_at_id", "outbox")
    op.create_index("ix_outbox_target_due_at_id", "outbox", ["target", "due_at", "id"])
    outbox = sa.table("outbox", sa.column("due_at", TIME), sa.column("attempts", sa.Integer()))
    op.execute(
        sa.update(outbox).where(outbox.c.attempts == 0).values(due_at=datetime(1970, 1, 1, tzinfo=UTC))
    )
    # versions of before left there what the camera was unsure of
    op.execute("UPDATE parts SET text = '', text_folded = '' WHERE state = 'touch_needed'")
    seals = op.create_table(
        "seals",
        sa.Column("id", ROW, autoincrement=True, nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_seals"),
        sa.Column("part_id", PART_ID, nullable=False),
        sa.ForeignKeyConstraint(["part_id"], ["parts.id"], name="fk_seals_part_id"),
        sa.Column("number", sa.Integer(), nullable=False),
        *(sa.Column(f"last_{name}", ROW, nullable=False) for name in SEALED),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.UniqueConstraint("part_id", "number", name="uq_seals_part_id"),
    )
    if op.get_bind().dialect.name == "sqlite":
        _guard_in_sqlite()
    else:
        _guard_in_postgresql()
    for page in _pages():
        op.get_bind().execute(sa.insert(seals), page)


def _pages() -> Iterator[list[dict[str, Any]]]:
    """The first seal of every part, which covers all there is of it."""
    parts = sa.table("parts", sa.column("id", PART_ID))
    after = ""
    asked = sa.select(parts.c.id).order_by(parts.c.id).limit(PAGE)
    while ids := list(op.get_bind().execute(asked.where(parts.c.id > after)).scalars()):
        found = {name: _lines(name, ids[0], ids[-1]) for name in SEALED}
        page = []
        for part_id in ids:
            rows = {name: found[name].get(part_id, (0, [])) for name in SEALED}
            text = "\n".join(
                (json.dumps([part_id, 1, ""]), *(line for _, lines in rows.values() for line in lines))
            )
            row = {"part_id": part_id, "number": 1, "digest": hashlib.sha256(text.encode()).hexdigest()}
            page.append({**row, **{f"last_{name}": last for name, (last, _) in rows.items()}})
        yield page
        after = ids[-1]


def _lines(name: str, first: str, last: str) -> dict[str, tuple[int, list[str]]]:
    """The last row's id and every row's line, by part."""
    columns: dict[str, sa.types.TypeEngine[Any]] = {"id": ROW, "part_id": PART_ID, **SEALED[name]}
    table = sa.table(name, *(sa.column(column, kind) for column, kind in columns.items()))
    asked = sa.select(table).where(table.c.part_id.between(first, last)).order_by(table.c.part_id, table.c.id)
    rows = op.get_bind().execute(asked).mappings()
    made = {}
    for part_id, of_part in groupby(rows, lambda row: str(row["part_id"])):
        kept = list(of_part)
        made[part_id] = (int(kept[-1]["id"]), [_line(name, dict(row)) for row in kept])
    return made


def _line(name: str, row: dict[str, Any]) -> str:
    for column, value in row.items():
        if isinstance(value, datetime):
            at = value if value.tzinfo is not None else value.replace(tzinfo=UTC)
            row[column] = at.astimezone(UTC).isoformat()
    return json.dumps([name, {c: v for c, v in row.items() if v is not None}], sort_keys=True)


def _guard_in_sqlite() -> None:
    refused = "RAISE(ABORT, 'seals are never changed')"
    for verb in ("UPDATE", "DELETE"):
        op.execute(
            f"CREATE TRIGGER seals_no_{verb.lower()} BEFORE {verb} ON seals BEGIN SELECT {refused}; END"
        )
    op.execute(
        "CREATE TRIGGER seals_no_replace BEFORE INSERT ON seals"
        " WHEN EXISTS (SELECT 1 FROM seals WHERE id = NEW.id"
        " OR (part_id = NEW.part_id AND number = NEW.number))"
        f" BEGIN SELECT {refused}; END"
    )


def _guard_in_postgresql() -> None:
    for name, verbs, each in (
        ("changed", "UPDATE OR DELETE", "ROW"),
        ("emptied", "TRUNCATE", "STATEMENT"),
    ):
        op.execute(
            f"CREATE TRIGGER seals_never_{name} BEFORE {verbs} ON seals"
            f" FOR EACH {each} EXECUTE FUNCTION tactile_marks_never_changed()"
        )


def downgrade() -> None:
    """The seals are lost, and made anew when the store is brought up to date again."""
    op.drop_table("seals")
    op.drop_index("ix_outbox_target_due_at_id", "outbox")
    op.create_index("ix_outbox_due_at_id", "outbox", ["due_at", "id"])
    for name in ("owner", "leased_until"):
        op.drop_column("outbox", name)
