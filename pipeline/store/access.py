"""Tokens of callers, and sessions of signed-in browsers; the store keeps only hashes of their secrets. A session ends
with its token, by signing out, or after a shift."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from datetime import datetime, timedelta

import sqlalchemy as sa

from pipeline.common.names import clean_name, folded
from pipeline.common.records import Scope, TokenRecord
from pipeline.store.database import Transaction
from pipeline.store.errors import ConflictError, NotFoundError, UnfitError, fit
from pipeline.store.rows import hash_of, record_of
from pipeline.store.tables import sessions, tokens

# secret scanners find leaked tokens by it
PREFIX = "tm_"
# length of a shift, s
SIGNED_IN_S = 12 * 3600


def new_token() -> str:
    """A secret of 256 random bits."""
    return PREFIX + secrets.token_urlsafe(32)


def add_token(
    tx: Transaction,
    name: str,
    scopes: Iterable[Scope],
    *,
    expires_at: datetime | None = None,
) -> str:
    """Make a token and return its secret, which is kept nowhere. Raises ConflictError: the name is taken, or was."""
    granted = sorted({Scope(scope) for scope in scopes})
    if not granted:
        raise UnfitError("a token without a scope allows nothing", hint=f"give some of {', '.join(Scope)}")
    name = clean_name(name)
    if not name:
        raise UnfitError("a token needs a name", hint="give one, such as line-3")
    if expires_at is not None and (expires_at.tzinfo is None or expires_at <= tx.now):
        raise UnfitError(
            "the token would have expired or has no time zone", hint="give a time to come in UTC"
        )
    secret = new_token()
    row = {"name": fit(name, "the token's name"), "secret_hash": hash_of(secret), "scopes": granted}
    namesake = _token_name(tx, name)
    if namesake is not None or not tx.insert_if_new(
        tokens, {**row, "created_at": tx.now, "expires_at": expires_at}
    ):
        what = f"there is or was a token {namesake or name!r}, and reviews are signed with it"
        raise ConflictError(what, hint="choose another name")
    return secret


def token(tx: Transaction, secret: str) -> TokenRecord | None:
    """The token with that secret; None if it is unknown, expired or revoked."""
    return _token_of_hash(tx, hash_of(secret))


def _token_of_hash(tx: Transaction, secret_hash: str) -> TokenRecord | None:
    valid = sa.or_(tokens.c.expires_at.is_(None), tokens.c.expires_at > tx.now)
    query = sa.select(tokens).where(tokens.c.secret_hash == secret_hash, tokens.c.revoked_at.is_(None), valid)
    row = tx.execute(query).one_or_none()
    return None if row is None else record_of(TokenRecord, row)


def all_tokens(tx: Transaction) -> tuple[TokenRecord, ...]:
    """Every token, oldest first, also those that are refused."""
    rows = tx.execute(sa.select(tokens).order_by(tokens.c.created_at, tokens.c.name))
    return tuple(record_of(TokenRecord, row) for row in rows)


def revoke(tx: Transaction, name: str) -> None:
    """Revoke a token; nothing happens if it was revoked before."""
    known = _token_name(tx, name)
    if known is None:
        raise NotFoundError(f"there is no token {name[:40]!r}", hint="`tactile-marks tokens list` names them")
    unrevoked = sa.and_(tokens.c.name == known, tokens.c.revoked_at.is_(None))
    tx.execute(sa.update(tokens).where(unrevoked).values(revoked_at=tx.now))


def _token_name(tx: Transaction, name: str) -> str | None:
    names = tx.execute(sa.select(tokens.c.name)).scalars()
    return next((known for known in names if folded(known) == folded(name)), None)


def open_session(tx: Transaction, secret: str) -> str | None:
    """The cookie of a new session; None without a valid token of that secret."""
    if token(tx, secret) is None:
        return None
    tx.execute(sa.delete(sessions).where(sessions.c.created_at <= tx.now - timedelta(seconds=SIGNED_IN_S)))
    cookie = new_token()
    row = {"cookie_hash": hash_of(cookie), "token_hash": hash_of(secret), "created_at": tx.now}
    tx.execute(sa.insert(sessions).values(**row))
    return cookie


def session_token(tx: Transaction, cookie: str) -> TokenRecord | None:
    """The token of the session with that cookie; None if there is none now."""
    query = sa.select(sessions.c.token_hash).where(
        sessions.c.cookie_hash == hash_of(cookie),
        sessions.c.created_at > tx.now - timedelta(seconds=SIGNED_IN_S),
    )
    hash_of_token = tx.execute(query).scalar_one_or_none()
    return None if hash_of_token is None else _token_of_hash(tx, hash_of_token)


def close_session(tx: Transaction, cookie: str) -> None:
    """End the session with that cookie, if there is one."""
    tx.execute(sa.delete(sessions).where(sessions.c.cookie_hash == hash_of(cookie)))
