"""Which job a part was read by.

Revision ID: 0003
Revises: 0002
Create Date: 2026-11-23
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Parts of before were read by the service's own settings."""
    op.add_column("parts", sa.Column("job", sa.Text(), nullable=True))


def downgrade() -> None:
    """Which job it was is lost."""
    op.drop_column("parts", "job")
