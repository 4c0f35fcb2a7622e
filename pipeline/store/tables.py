"""The tables of the store.

    idempotency >--- parts ---< readings   (*)
        outbox >-----/  | \\---< reviews    (*)     tokens stand alone
        claims >-----/  |  |--< events     (*)
        audits >-----/  |  \\--< seals      (*)     golden stands alone; (*) triggers refuse every change and removal
        alerts >-----/   \\---< evidence

What a part's row holds beside its own (its last reading and review, the columns of the statistics) all follows from the
rows that never change; it stands there so that lists and figures need no more than an index.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Dialect

from pipeline.store.errors import UnfitError

METADATA = sa.MetaData(
    naming_convention={
        "pk": "pk_%(table_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_name)s",
    }
)


class UtcTime(sa.TypeDecorator[datetime]):
    """An aware time, kept and given in UTC; SQLite itself keeps no zone."""

    impl = sa.DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """To the database."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise UnfitError(f"the time {value} has no zone", hint="give it in UTC")
        return value.astimezone(UTC)

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:
        """From the database."""
        if value is None:
            return None
        made: datetime = value if value.tzinfo is not None else value.replace(tzinfo=UTC)
        return made.astimezone(UTC)


# SQLite counts rows by INTEGER PRIMARY KEY alone
_ROW = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
# ids sort by their bytes, whatever the language of the server
_PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")


def _row_id() -> sa.Column[int]:
    return sa.Column("id", _ROW, primary_key=True, autoincrement=True)


def _of_part() -> sa.Column[str]:
    return sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), nullable=False)


parts = sa.Table(
    "parts",
    METADATA,
    sa.Column("id", _PART_ID, primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("state", sa.String(16), nullable=False),
    sa.Column("text", sa.Text, nullable=False),
    # casefolded, to be searched: the databases differ in what lower case is
    sa.Column("name_folded", sa.Text, nullable=False),
    sa.Column("text_folded", sa.Text, nullable=False),
    sa.Column("expected", sa.Text, nullable=False),
    sa.Column("database", sa.Text, nullable=False),
    sa.Column("job", sa.Text),
    sa.Column("line", sa.Text),
    sa.Column("plan", sa.JSON(none_as_null=True)),
    # while it waits for touch: whether the stage of its line is to feel it, and when a person gets it all the same
    sa.Column("touch_by_stage", sa.Boolean),
    sa.Column("touch_until", UtcTime),
    sa.Column("created_at", UtcTime, nullable=False),
    sa.Column("changed_at", UtcTime, nullable=False),
    # no foreign keys, for those rows name this one; they are never removed
    sa.Column("reading_id", _ROW),
    sa.Column("review_id", _ROW),
    sa.Column("fell_back", sa.Boolean, nullable=False),
    sa.Column("by_camera", sa.Boolean, nullable=False),
    sa.Column("rejected", sa.Boolean, nullable=False),
    # after review: whether the reading was right, of how many characters, and how many of them
    sa.Column("was_right", sa.Boolean),
    sa.Column("characters", sa.Integer),
    sa.Column("characters_right", sa.Integer),
    # of a part read in shadow mode: whether the line's own reader has said the same, and where it would stand
    sa.Column("agreement", sa.String(16)),
    sa.Column("would_be", sa.String(16)),
    sa.Index(None, "state", "id"),
    sa.Index(None, "text_folded"),
    sa.Index(None, "agreement", "id"),
    sa.Index(None, "agreement", "created_at", "would_be"),
    sa.Index(
        "ix_parts_figures",
        "created_at",
        "state",
        "fell_back",
        "by_camera",
        "rejected",
        "was_right",
        "characters",
        "characters_right",
    ),
)

readings = sa.Table(
    "readings",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("source", sa.String(16), nullable=False),
    sa.Column("text", sa.Text, nullable=False),
    sa.Column("decision", sa.String(16), nullable=False),
    sa.Column("confidence", sa.Double, nullable=False),
    sa.Column("seconds", sa.Double, nullable=False),
    sa.Column("record", sa.JSON, nullable=False),
    sa.Index(None, "part_id"),
    sa.Index(None, "at", "source", "seconds"),
)

evidence = sa.Table(
    "evidence",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("kind", sa.String(32), nullable=False),
    sa.Column("sha256", sa.String(64), nullable=False),
    sa.Column("n_bytes", sa.BigInteger, nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("media_type", sa.Text, nullable=False),
    sa.Column("meta", sa.JSON, nullable=False),
    sa.Column("gone", sa.Boolean, nullable=False),
    sa.Index(None, "part_id"),
    sa.Index(None, "sha256", "gone"),
    sa.Index(None, "gone", "at"),
)

reviews = sa.Table(
    "reviews",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("action", sa.String(16), nullable=False),
    sa.Column("before", sa.Text, nullable=False),
    sa.Column("after", sa.Text, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("token", sa.Text, nullable=False),
    sa.Column("note", sa.Text, nullable=False),
    sa.Index(None, "part_id"),
)

events = sa.Table(
    "events",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("kind", sa.String(32), nullable=False),
    sa.Column("data", sa.JSON, nullable=False),
    sa.Index(None, "part_id"),
)

seals = sa.Table(
    "seals",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("number", sa.Integer, nullable=False),
    # the last row that it covers, 0 where there is none
    *(
        sa.Column(f"last_{name}", _ROW, nullable=False)
        for name in ("readings", "reviews", "evidence", "events")
    ),
    sa.Column("digest", sa.String(64), nullable=False),
    sa.UniqueConstraint("part_id", "number"),
)

idempotency = sa.Table(
    "idempotency",
    METADATA,
    # the key's SHA-256: callers choose keys of any length and alphabet
    sa.Column("key_hash", sa.String(64), primary_key=True),
    sa.Column("fingerprint", sa.Text, nullable=False),
    sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), nullable=False),
    sa.Column("at", UtcTime, nullable=False),
    sa.Index(None, "at"),
)

outbox = sa.Table(
    "outbox",
    METADATA,
    _row_id(),
    _of_part(),
    sa.Column("target", sa.String(32), nullable=False),
    sa.Column("payload", sa.JSON, nullable=False),
    sa.Column("attempts", sa.Integer, nullable=False),
    sa.Column("error", sa.Text, nullable=False),
    sa.Column("created_at", UtcTime, nullable=False),
    sa.Column("due_at", UtcTime, nullable=False),
    # the dispatcher that is at it, and until when the others leave it alone
    sa.Column("owner", sa.String(32)),
    sa.Column("leased_until", UtcTime),
    sa.Index(None, "target", "due_at", "id"),
    sa.Index(None, "part_id", "target", "id"),
    # a number is never given twice, for by it receivers know what they have had
    sqlite_autoincrement=True,
)

claims = sa.Table(
    "claims",
    METADATA,
    sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), primary_key=True),
    sa.Column("holder", sa.Text, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("until", UtcTime, nullable=False),
)

audits = sa.Table(
    "audits",
    METADATA,
    sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), primary_key=True),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("done_at", UtcTime),
    sa.Column("who", sa.Text),
    sa.Column("token", sa.Text),
    sa.Column("action", sa.String(16)),
    sa.Column("text", sa.Text),
    sa.Column("same", sa.Boolean),
    sa.Index(None, "at"),
)

# those that are raised now
alerts = sa.Table(
    "alerts",
    METADATA,
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), nullable=False),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("message", sa.Text, nullable=False),
)

golden = sa.Table(
    "golden",
    METADATA,
    _row_id(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("line", sa.Text, nullable=False),
    sa.Column("reference", sa.Boolean, nullable=False),
    sa.Column("measures", sa.JSON, nullable=False),
    sa.Index(None, "line", "id"),
)

tokens = sa.Table(
    "tokens",
    METADATA,
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("secret_hash", sa.String(64), nullable=False),
    sa.Column("scopes", sa.JSON, nullable=False),
    sa.Column("created_at", UtcTime, nullable=False),
    sa.Column("expires_at", UtcTime),
    sa.Column("revoked_at", UtcTime),
    sa.UniqueConstraint("secret_hash"),
)

sessions = sa.Table(
    "sessions",
    METADATA,
    sa.Column("cookie_hash", sa.String(64), primary_key=True),
    sa.Column("token_hash", sa.String(64), nullable=False),
    sa.Column("created_at", UtcTime, nullable=False),
)
