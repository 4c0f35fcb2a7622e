"""Who is at which part, audits of accepted parts, and alerts that are raised.

Revision ID: 0006
Revises: 0005
Create Date: 2026-11-23
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

# ids sort by their bytes, whatever the language of the server
PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")
TIME = sa.DateTime(timezone=True)


def _part_key(table: str) -> list[sa.schema.SchemaItem]:
    return [
        sa.Column("part_id", PART_ID, sa.ForeignKey("parts.id", name=f"fk_{table}_part_id"), nullable=False),
        sa.PrimaryKeyConstraint("part_id", name=f"pk_{table}"),
    ]


def upgrade() -> None:
    """Nobody is at anything, and nothing was drawn."""
    op.create_table(
        "claims",
        *_part_key("claims"),
        sa.Column("holder", sa.Text(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("until", TIME, nullable=False),
    )
    op.create_table(
        "audits",
        *_part_key("audits"),
        sa.Column("at", TIME, nullable=False),
        sa.Column("done_at", TIME),
        sa.Column("who", sa.Text()),
        sa.Column("token", sa.Text()),
        sa.Column("action", sa.String(16)),
        sa.Column("text", sa.Text()),
        sa.Column("same", sa.Boolean()),
    )
    op.create_index("ix_audits_at", "audits", ["at"])
    op.create_table(
        "alerts",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("part_id", PART_ID, sa.ForeignKey("parts.id", name="fk_alerts_part_id"), nullable=False),
        sa.Column("at", TIME, nullable=False),
        sa.Column("message", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_alerts"),
    )


def downgrade() -> None:
    """What audits have found is lost, but for the events of their parts."""
    for table in ("alerts", "audits", "claims"):
        op.drop_table(table)
