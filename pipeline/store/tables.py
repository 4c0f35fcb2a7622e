"""The tables of the store.

    parts ---< events     (read, reviewed, ...: only added to, triggers refuse every change)
          ---< evidence   (files, each named by its hash)
          ---< outbox     (results that wait to be sent)
          ---< idempotency, alerts
    golden, tokens, sessions

A part's row holds its record as JSON, as it is answered and published, and the columns that lists and figures search.
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
        if value is not None and value.tzinfo is None:
            raise UnfitError(f"the time {value} has no zone", hint="give it in UTC")
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:
        """From the database."""
        if value is None:
            return None
        made: datetime = value if value.tzinfo is not None else value.replace(tzinfo=UTC)
        return made.astimezone(UTC)


TEXT, FLAG, NUMBER, JSON = sa.Text(), sa.Boolean(), sa.Integer(), sa.JSON()
WORD, HASH = sa.String(16), sa.String(64)
# SQLite counts rows by INTEGER PRIMARY KEY alone
_ROW = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
# ids sort by their bytes, whatever the language of the server
_PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")


def _key(name: str, kind: sa.types.TypeEngine[Any] = _ROW) -> sa.Column[Any]:
    return sa.Column(name, kind, primary_key=True, autoincrement=kind is _ROW)


def _filled(name: str, kind: sa.types.TypeEngine[Any] | type[UtcTime] = TEXT) -> sa.Column[Any]:
    return sa.Column(name, kind, nullable=False)


def _of_part() -> sa.Column[str]:
    return sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), nullable=False)


parts = sa.Table(
    "parts",
    METADATA,
    _key("id", _PART_ID),
    _filled("state", WORD),
    _filled("created_at", UtcTime),
    _filled("changed_at", UtcTime),
    # casefolded, to be searched: the databases differ in what lower case is
    _filled("name_folded"),
    _filled("text_folded"),
    _filled("job"),
    _filled("line"),
    # while it waits for touch: whether the stage of its line is to feel it, and when a person gets it all the same
    sa.Column("touch_by_stage", FLAG),
    sa.Column("touch_until", UtcTime),
    _filled("fell_back", FLAG),
    _filled("by_camera", FLAG),
    _filled("rejected", FLAG),
    # after review: whether the reading was right, of how many characters, and how many of them
    sa.Column("was_right", FLAG),
    sa.Column("characters", NUMBER),
    sa.Column("characters_right", NUMBER),
    # of a part read in shadow mode: whether the line's own reader has said the same, and where it would stand
    sa.Column("agreement", WORD),
    sa.Column("would_be", WORD),
    # of an accepted part drawn to be read by a person as well: waiting, or what came of it
    sa.Column("audit", WORD),
    # the person who has it open, and until when the others leave it alone
    sa.Column("claim_holder", TEXT),
    sa.Column("claim_who", TEXT),
    sa.Column("claim_until", UtcTime),
    # last: SQLite reads a row from its beginning, and lists need not read as far
    _filled("record", JSON),
    sa.Index("ix_parts_search", "id", "state", "name_folded", "text_folded", "job", "line", "created_at"),
    sa.Index(None, "state", "id"),
    sa.Index(None, "text_folded"),
    sa.Index(None, "agreement", "id"),
    sa.Index(None, "agreement", "created_at", "would_be"),
    sa.Index(None, "audit", "id"),
    sa.Index(None, "audit", "created_at"),
    sa.Index(
        "ix_parts_figures",
        *("created_at", "state", "fell_back", "by_camera", "rejected"),
        *("was_right", "characters", "characters_right"),
    ),
)

events = sa.Table(
    "events",
    METADATA,
    _key("id"),
    _of_part(),
    _filled("at", UtcTime),
    _filled("kind", sa.String(32)),
    # of readings their source and duration, of a first reader's opinion who it was
    sa.Column("actor", TEXT),
    sa.Column("seconds", sa.Double),
    _filled("data", JSON),
    sa.Index(None, "part_id"),
    sa.Index(None, "kind", "at", "actor", "seconds"),
)

evidence = sa.Table(
    "evidence",
    METADATA,
    _key("id"),
    _of_part(),
    _filled("at", UtcTime),
    _filled("kind", sa.String(32)),
    _filled("sha256", HASH),
    _filled("n_bytes", sa.BigInteger()),
    _filled("name"),
    _filled("media_type"),
    _filled("meta", JSON),
    _filled("gone", FLAG),
    sa.Index(None, "part_id"),
    sa.Index(None, "sha256", "gone"),
    sa.Index(None, "gone", "at"),
)

idempotency = sa.Table(
    "idempotency",
    METADATA,
    # the key's SHA-256: callers choose keys of any length and alphabet
    _key("key_hash", HASH),
    _filled("fingerprint"),
    _of_part(),
    _filled("at", UtcTime),
    sa.Index(None, "at"),
)

outbox = sa.Table(
    "outbox",
    METADATA,
    _key("id"),
    _of_part(),
    _filled("target", sa.String(32)),
    _filled("payload", JSON),
    _filled("attempts", NUMBER),
    _filled("error"),
    _filled("created_at", UtcTime),
    _filled("due_at", UtcTime),
    # the dispatcher that is at it, and until when the others leave it alone
    sa.Column("owner", sa.String(32)),
    sa.Column("leased_until", UtcTime),
    sa.Index(None, "target", "due_at", "id"),
    sa.Index(None, "part_id", "target", "id"),
    # a number is never given twice, for by it receivers know what they have had
    sqlite_autoincrement=True,
)

# those that are raised now
alerts = sa.Table(
    "alerts", METADATA, _key("name", TEXT), _of_part(), _filled("at", UtcTime), _filled("message")
)

golden = sa.Table(
    "golden",
    METADATA,
    _key("id"),
    _filled("line"),
    _filled("reference", FLAG),
    _filled("record", JSON),
    sa.Index(None, "line", "id"),
)

tokens = sa.Table(
    "tokens",
    METADATA,
    _key("name", TEXT),
    _filled("secret_hash", HASH),
    _filled("scopes", JSON),
    _filled("created_at", UtcTime),
    sa.Column("expires_at", UtcTime),
    sa.Column("revoked_at", UtcTime),
    sa.UniqueConstraint("secret_hash"),
)

sessions = sa.Table(
    "sessions",
    METADATA,
    _key("cookie_hash", HASH),
    _filled("token_hash", HASH),
    _filled("created_at", UtcTime),
)

_REFUSED = "events are never changed"
_GUARDS = {
    "sqlite": (
        *(
            f"CREATE TRIGGER events_no_{verb} BEFORE {verb} ON events BEGIN SELECT RAISE(ABORT, '{_REFUSED}'); END"
            for verb in ("update", "delete")
        ),
        # INSERT OR REPLACE removes a row without telling the trigger above
        "CREATE TRIGGER events_no_replace BEFORE INSERT ON events WHEN EXISTS"
        f" (SELECT 1 FROM events WHERE id = NEW.id) BEGIN SELECT RAISE(ABORT, '{_REFUSED}'); END",
    ),
    "postgresql": (
        "CREATE FUNCTION tactile_marks_never_changed() RETURNS trigger LANGUAGE plpgsql AS"
        f" $$ BEGIN RAISE EXCEPTION '{_REFUSED}'; END $$",
        "CREATE TRIGGER events_never_changed BEFORE UPDATE OR DELETE ON events"
        " FOR EACH ROW EXECUTE FUNCTION tactile_marks_never_changed()",
        "CREATE TRIGGER events_never_emptied BEFORE TRUNCATE ON events"
        " FOR EACH STATEMENT EXECUTE FUNCTION tactile_marks_never_changed()",
    ),
}
for _dialect, _statements in _GUARDS.items():
    for _statement in _statements:
        _guard = sa.DDL(_statement)  # type: ignore[no-untyped-call]
        sa.event.listen(events, "after_create", _guard.execute_if(dialect=_dialect))
