"""Who feels a part that waits for touch, until when it waits, and which line it came from.

Revision ID: 0004
Revises: 0003
Create Date: 2026-11-23
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

COLUMNS: dict[str, sa.types.TypeEngine[Any]] = {
    "touch_by_stage": sa.Boolean(),
    "touch_until": sa.DateTime(timezone=True),
    "line": sa.Text(),
}


def upgrade() -> None:
    """Parts of before that wait for touch belong to whoever sent them, until they are given up."""
    for name, kind in COLUMNS.items():
        op.add_column("parts", sa.Column(name, kind, nullable=True))


def downgrade() -> None:
    """Who was to feel them is lost."""
    for name in COLUMNS:
        op.drop_column("parts", name)
