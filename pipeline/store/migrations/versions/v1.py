"""The tables of release 0.1.0, the base that later versions change: an empty database has them at once.

Revision ID: v1 Revises: Create Date: 2026-11-26
"""

from __future__ import annotations

revision = "v1"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Change nothing."""
