"""What came of parts that were read in the shadow of the line's own reader.

Revision ID: 0002
Revises: 0001
Create Date: 2026-11-23
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

INDEXES = {
    "ix_parts_agreement_id": ["agreement", "id"],
    "ix_parts_agreement_created_at_would_be": ["agreement", "created_at", "would_be"],
}


def upgrade() -> None:
    """Parts of before were not read so."""
    for name in ("agreement", "would_be"):
        op.add_column("parts", sa.Column(name, sa.String(16), nullable=True))
    for name, columns in INDEXES.items():
        op.create_index(name, "parts", columns)


def downgrade() -> None:
    """What was compared is lost."""
    for name in INDEXES:
        op.drop_index(name, "parts")
    for name in ("agreement", "would_be"):
        op.drop_column("parts", name)
