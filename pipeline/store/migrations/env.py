"""Run by Alembic: the migrations, on the connection and in the transaction that `pipeline.store.database` holds."""

from __future__ import annotations

from alembic import context

from pipeline.store.database import VERSION_TABLE
from pipeline.store.tables import METADATA

connection = context.config.attributes["connection"]
context.configure(
    connection=connection,
    target_metadata=METADATA,
    version_table=VERSION_TABLE,
    render_as_batch=True,
)
with context.begin_transaction():
    context.run_migrations()
