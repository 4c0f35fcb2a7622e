"""Parts found by their serial.

Revision ID: 0007
Revises: 0006
Create Date: 2026-11-23
"""

from __future__ import annotations

from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Whether a serial was read before is asked of every part."""
    op.create_index("ix_parts_text_folded", "parts", ["text_folded"])


def downgrade() -> None:
    """It takes longer then."""
    op.drop_index("ix_parts_text_folded", "parts")
