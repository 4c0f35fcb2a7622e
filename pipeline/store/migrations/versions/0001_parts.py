"""Parts, what was read, felt, seen and said of them, results to be sent, and tokens.

Revision ID: 0001
Revises:
Create Date: 2026-11-21
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

ROW = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")
TIME = sa.DateTime(timezone=True)
NEVER_CHANGED = ("readings", "reviews", "events")


def _of_part(table: str) -> list[sa.schema.SchemaItem]:
    return [
        sa.Column("part_id", PART_ID, nullable=False),
        sa.ForeignKeyConstraint(["part_id"], ["parts.id"], name=f"fk_{table}_part_id"),
    ]


def _row(table: str) -> list[sa.schema.SchemaItem]:
    return [
        sa.Column("id", ROW, autoincrement=True, nullable=False),
        sa.PrimaryKeyConstraint("id", name=f"pk_{table}"),
        *_of_part(table),
    ]


def upgrade() -> None:
    """From nothing."""
    op.create_table(
        "parts",
        sa.Column("id", PART_ID, nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("name_folded", sa.Text(), nullable=False),
        sa.Column("text_folded", sa.Text(), nullable=False),
        sa.Column("expected", sa.Text(), nullable=False),
        sa.Column("database", sa.Text(), nullable=False),
        sa.Column("plan", sa.JSON(), nullable=True),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("changed_at", TIME, nullable=False),
        sa.Column("reading_id", ROW, nullable=True),
        sa.Column("review_id", ROW, nullable=True),
        sa.Column("fell_back", sa.Boolean(), nullable=False),
        sa.Column("by_camera", sa.Boolean(), nullable=False),
        sa.Column("rejected", sa.Boolean(), nullable=False),
        sa.Column("was_right", sa.Boolean(), nullable=True),
        sa.Column("characters", sa.Integer(), nullable=True),
        sa.Column("characters_right", sa.Integer(), nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_parts"),
    )
    op.create_index("ix_parts_state_id", "parts", ["state", "id"])
    op.create_index(
        "ix_parts_figures",
        "parts",
        [
            "created_at",
            "state",
            "fell_back",
            "by_camera",
            "rejected",
            "was_right",
            "characters",
            "characters_right",
        ],
    )
    op.create_table(
        "readings",
        *_row("readings"),
        sa.Column("at", TIME, nullable=False),
        sa.Column("source", sa.String(16), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("decision", sa.String(16), nullable=False),
        sa.Column("confidence", sa.Double(), nullable=False),
        sa.Column("seconds", sa.Double(), nullable=False),
        sa.Column("record", sa.JSON(), nullable=False),
    )
    op.create_index("ix_readings_part_id", "readings", ["part_id"])
    op.create_index("ix_readings_at_source_seconds", "readings", ["at", "source", "seconds"])
    op.create_table(
        "evidence",
        *_row("evidence"),
        sa.Column("at", TIME, nullable=False),
        sa.Column("kind", sa.String(32), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("n_bytes", sa.BigInteger(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("media_type", sa.Text(), nullable=False),
        sa.Column("meta", sa.JSON(), nullable=False),
        sa.Column("gone", sa.Boolean(), nullable=False),
    )
    op.create_index("ix_evidence_part_id", "evidence", ["part_id"])
    op.create_index("ix_evidence_sha256_gone", "evidence", ["sha256", "gone"])
    op.create_index("ix_evidence_gone_at", "evidence", ["gone", "at"])
    op.create_table(
        "reviews",
        *_row("reviews"),
        sa.Column("at", TIME, nullable=False),
        sa.Column("action", sa.String(16), nullable=False),
        sa.Column("before", sa.Text(), nullable=False),
        sa.Column("after", sa.Text(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("token", sa.Text(), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
    )
    op.create_index("ix_reviews_part_id", "reviews", ["part_id"])
    op.create_table(
        "events",
        *_row("events"),
        sa.Column("at", TIME, nullable=False),
        sa.Column("kind", sa.String(32), nullable=False),
        sa.Column("data", sa.JSON(), nullable=False),
    )
    op.create_index("ix_events_part_id", "events", ["part_id"])
    op.create_table(
        "idempotency",
        sa.Column("key_hash", sa.String(64), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        *_of_part("idempotency"),
        sa.Column("at", TIME, nullable=False),
        sa.PrimaryKeyConstraint("key_hash", name="pk_idempotency"),
    )
    op.create_index("ix_idempotency_at", "idempotency", ["at"])
    op.create_table(
        "outbox",
        *_row("outbox"),
        sa.Column("target", sa.String(32), nullable=False),
        sa.Column("payload", sa.JSON(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("error", sa.Text(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("due_at", TIME, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_outbox_due_at_id", "outbox", ["due_at", "id"])
    op.create_index("ix_outbox_part_id_target_id", "outbox", ["part_id", "target", "id"])
    op.create_table(
        "tokens",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("secret_hash", sa.String(64), nullable=False),
        sa.Column("scopes", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("expires_at", TIME, nullable=True),
        sa.Column("revoked_at", TIME, nullable=True),
        sa.PrimaryKeyConstraint("name", name="pk_tokens"),
        sa.UniqueConstraint("secret_hash", name="uq_tokens_secret_hash"),
    )
    for table in NEVER_CHANGED:
        if op.get_bind().dialect.name == "sqlite":
            _guard_in_sqlite(table)
    if op.get_bind().dialect.name == "postgresql":
        _guard_in_postgresql()


def _guard_in_sqlite(table: str) -> None:
    refused = f"RAISE(ABORT, '{table} are never changed')"
    for verb in ("UPDATE", "DELETE"):
        op.execute(
            f"CREATE TRIGGER {table}_no_{verb.lower()} BEFORE {verb} ON {table} BEGIN SELECT {refused}; END"
        )
    # INSERT OR REPLACE removes a row without telling the trigger above
    op.execute(
        f"CREATE TRIGGER {table}_no_replace BEFORE INSERT ON {table}"
        f" WHEN EXISTS (SELECT 1 FROM {table} WHERE id = NEW.id) BEGIN SELECT {refused}; END"
    )


def _guard_in_postgresql() -> None:
    op.execute(
        "CREATE FUNCTION tactile_marks_never_changed() RETURNS trigger LANGUAGE plpgsql AS"
        " $$ BEGIN RAISE EXCEPTION '% are never changed', TG_TABLE_NAME; END $$"
    )
    for table in NEVER_CHANGED:
        op.execute(
            f"CREATE TRIGGER {table}_never_changed BEFORE UPDATE OR DELETE ON {table}"
            " FOR EACH ROW EXECUTE FUNCTION tactile_marks_never_changed()"
        )
        op.execute(
            f"CREATE TRIGGER {table}_never_emptied BEFORE TRUNCATE ON {table}"
            " FOR EACH STATEMENT EXECUTE FUNCTION tactile_marks_never_changed()"
        )


def downgrade() -> None:
    """To nothing: everything is lost."""
    for table in ("tokens", "outbox", "idempotency", "events", "reviews", "evidence", "readings", "parts"):
        op.drop_table(table)
    if op.get_bind().dialect.name == "postgresql":
        op.execute("DROP FUNCTION tactile_marks_never_changed()")
