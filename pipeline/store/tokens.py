"""Tokens in the store."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from pipeline.common.records import Scope, TokenRecord
from pipeline.store.database import Transaction
from pipeline.store.errors import ConflictError, NotFoundError, UnfitError, fit
from pipeline.store.tables import tokens
from pipeline.store.token_secrets import new_token, token_hash


def add_token(
    tx: Transaction,
    name: str,
    scopes: Iterable[Scope],
    *,
    expires_at: datetime | None = None,
) -> str:
    """Make a token.

    Returns:
        Its secret, which is kept nowhere.

    Raises:
        ConflictError: the name, or one that looks like it, was given before; a revoked token keeps its name.
    """
    granted = sorted({Scope(scope) for scope in scopes})
    if not granted:
        raise UnfitError(
            "a token without a scope allows nothing", hint=f"give {', '.join(Scope)} or some of them"
        )
    if not name.strip() or not name.isprintable():
        raise UnfitError("a token needs a name of printable characters", hint="give one, such as line-3")
    if expires_at is not None and (expires_at.tzinfo is None or expires_at <= tx.now):
        raise UnfitError(
            "the token would have expired already or has no time zone", hint="give a time to come in UTC"
        )
    wanted = _spelt(fit(name, "the token's name"))
    for known in tx.execute(sa.select(tokens.c.name)).scalars():
        if _spelt(known) == wanted:
            raise ConflictError(
                f"there is or was a token {known!r}, and reviews are signed with it",
                hint="choose another name",
            )
    secret = new_token()
    tx.execute(
        sa.insert(tokens).values(
            name=name,
            secret_hash=token_hash(secret),
            scopes=granted,
            created_at=tx.now,
            expires_at=expires_at,
        )
    )
    return secret


def _spelt(name: str) -> str:
    """A name as a person takes it in: "Anna " and "anna" are one."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


def token(tx: Transaction, secret: str) -> TokenRecord | None:
    """The token with that secret; None if it is unknown, expired or revoked."""
    return token_of_hash(tx, token_hash(secret))


def token_of_hash(tx: Transaction, secret_hash: str) -> TokenRecord | None:
    """The token whose secret has that hash; None if it is unknown, expired or revoked."""
    row = tx.execute(sa.select(tokens).where(tokens.c.secret_hash == secret_hash)).one_or_none()
    if row is None or row.revoked_at is not None or (row.expires_at is not None and row.expires_at <= tx.now):
        return None
    return _record(row)


def all_tokens(tx: Transaction) -> tuple[TokenRecord, ...]:
    """Every token, oldest first, also those that are refused."""
    rows = tx.execute(sa.select(tokens).order_by(tokens.c.created_at, tokens.c.name))
    return tuple(_record(row) for row in rows)


def revoke(tx: Transaction, name: str) -> None:
    """Refuse a token from now on; nothing happens where it was revoked before."""
    known = tokens.c.name == fit(name, "the token's name")
    if tx.execute(sa.select(tokens.c.name).where(known)).one_or_none() is None:
        raise NotFoundError(f"there is no token {name[:40]!r}", hint="`tactile-marks tokens list` names them")
    tx.execute(sa.update(tokens).where(known, tokens.c.revoked_at.is_(None)).values(revoked_at=tx.now))


def _record(row: Row[Any]) -> TokenRecord:
    return TokenRecord(
        name=row.name,
        scopes=frozenset(Scope(scope) for scope in row.scopes),
        created_at=row.created_at,
        expires_at=row.expires_at,
        revoked_at=row.revoked_at,
    )
