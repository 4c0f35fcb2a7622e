"""The tables of the store. A part's row holds its record as JSON, and columns to search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
    """A time with zone, stored and returned in UTC; SQLite itself stores no zone."""

    impl = sa.DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is not None and value.tzinfo is None:
            raise UnfitError(f"the time {value} has no zone", hint="give it in UTC")
        try:
            return None if value is None else value.astimezone(UTC)
        except OverflowError as error:
            raise UnfitError(
                f"there is no {value} in UTC", hint="give a time of the years 1 to 9999"
            ) from error

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        aware: datetime = value if value.tzinfo is not None else value.replace(tzinfo=UTC)
        return aware.astimezone(UTC)


TEXT, FLAG, NUMBER, JSON, TIME = sa.Text(), sa.Boolean(), sa.Integer(), sa.JSON(), UtcTime()
WORD, LONG_WORD, HASH = sa.String(16), sa.String(32), sa.String(64)
_FIGURES = "created_at state fell_back by_camera rejected was_right characters characters_right"
# SQLite counts rows by INTEGER PRIMARY KEY alone
_ROW = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
# ids sort by their bytes, whatever the language of the server
_PART_ID = sa.String(26).with_variant(sa.String(26, collation="C"), "postgresql")


def _key(name: str, kind: sa.types.TypeEngine[Any] = _ROW) -> sa.Column[Any]:
    return sa.Column(name, kind, primary_key=True, autoincrement=kind is _ROW)


def _not_null(kind: sa.types.TypeEngine[Any], *names: str) -> Iterator[sa.Column[Any]]:
    return (sa.Column(name, kind, nullable=False) for name in names)


def _empty(kind: sa.types.TypeEngine[Any], *names: str) -> Iterator[sa.Column[Any]]:
    return (sa.Column(name, kind) for name in names)


def _of_part() -> sa.Column[str]:
    return sa.Column("part_id", _PART_ID, sa.ForeignKey("parts.id"), nullable=False)


def _table(name: str, *columns: Any, indexes: Sequence[str] = (), **options: Any) -> sa.Table:
    return sa.Table(
        name, METADATA, *columns, *(sa.Index(None, *names.split()) for names in indexes), **options
    )


parts = _table(
    "parts",
    _key("id", _PART_ID),
    *_not_null(WORD, "state"),
    *_not_null(TIME, "created_at", "changed_at"),
    # names and texts are casefolded, to be searched: the databases differ in what lower case is
    *_not_null(TEXT, "name_folded", "text_folded", "job", "line"),
    # while it waits for touch: whether the stage of its line is to feel it, and when a person gets it all the same
    *_empty(FLAG, "touch_by_stage"),
    *_empty(TIME, "touch_until"),
    *_not_null(FLAG, "fell_back", "by_camera", "rejected"),
    # after review: whether the reading was right, of how many characters, and how many of them
    *_empty(FLAG, "was_right"),
    *_empty(NUMBER, "characters", "characters_right"),
    # in shadow mode: whether the line's own reader agrees, and the state that the part would have; of an accepted
    # part drawn to be read by a person as well: waiting, or what came of it
    *_empty(WORD, "agreement", "would_be", "audit"),
    # the person that has it open, and the end of that claim
    *_empty(TEXT, "claim_holder", "claim_who"),
    *_empty(TIME, "claim_until"),
    # last: SQLite reads a row from its beginning, and lists need not read as far
    *_not_null(JSON, "record"),
    sa.Index("ix_parts_search", *["id", "state", "name_folded", "text_folded", "job", "line", "created_at"]),
    sa.Index("ix_parts_figures", *_FIGURES.split()),
    indexes=(
        *("state id", "text_folded", "audit id", "audit created_at"),
        *("agreement id", "agreement created_at would_be"),
    ),
)

events = _table(
    "events",
    _key("id"),
    _of_part(),
    *_not_null(TIME, "at"),
    *_not_null(LONG_WORD, "kind"),
    # source and duration of readings; name of the person for a first reader's opinion
    *_empty(TEXT, "actor"),
    *_empty(sa.Double(), "seconds"),
    *_not_null(JSON, "data"),
    indexes=("part_id", "kind at actor seconds"),
)

evidence = _table(
    "evidence",
    _key("id"),
    _of_part(),
    *_not_null(TIME, "at"),
    *_not_null(LONG_WORD, "kind"),
    *_not_null(HASH, "sha256"),
    *_not_null(sa.BigInteger(), "n_bytes"),
    *_not_null(TEXT, "name", "media_type"),
    *_not_null(JSON, "meta"),
    *_not_null(FLAG, "gone"),
    indexes=("part_id", "sha256 gone", "gone at"),
)

# the key's SHA-256: callers choose keys of any length and alphabet
idempotency = _table(
    "idempotency",
    _key("key_hash", HASH),
    *_not_null(TEXT, "fingerprint"),
    _of_part(),
    *_not_null(TIME, "at"),
    indexes=("at",),
)

outbox = _table(
    "outbox",
    _key("id"),
    _of_part(),
    *_not_null(LONG_WORD, "target"),
    *_not_null(JSON, "payload"),
    *_not_null(NUMBER, "attempts"),
    *_not_null(TEXT, "error"),
    *_not_null(TIME, "created_at", "due_at"),
    # the dispatcher that has leased it, and the end of the lease
    *_empty(LONG_WORD, "owner"),
    *_empty(TIME, "leased_until"),
    indexes=("target due_at id", "part_id target id"),
    # a number is never given twice: receivers recognise repetitions by it
    sqlite_autoincrement=True,
)

# those that are raised now
alerts = _table("alerts", _key("name", TEXT), _of_part(), *_not_null(TIME, "at"), *_not_null(TEXT, "message"))

golden = _table(
    "golden",
    _key("id"),
    *_not_null(TEXT, "line"),
    *_not_null(FLAG, "reference"),
    *_not_null(JSON, "record"),
    indexes=("line id",),
)

tokens = _table(
    "tokens",
    _key("name", TEXT),
    *_not_null(HASH, "secret_hash"),
    *_not_null(JSON, "scopes"),
    *_not_null(TIME, "created_at"),
    *_empty(TIME, "expires_at", "revoked_at"),
    sa.UniqueConstraint("secret_hash"),
)

sessions = _table(
    "sessions", _key("cookie_hash", HASH), *_not_null(HASH, "token_hash"), *_not_null(TIME, "created_at")
)
