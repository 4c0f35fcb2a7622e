"""Sessions of the pages: a browser that is signed in, by a cookie whose hash alone is kept.

A session belongs to one token, not to its name; it ends with the token, by signing out, or after a shift.
"""

from __future__ import annotations

from datetime import timedelta

import sqlalchemy as sa

from pipeline.common.records import TokenRecord
from pipeline.store.database import Transaction
from pipeline.store.tables import sessions
from pipeline.store.token_secrets import new_token, token_hash
from pipeline.store.tokens import token, token_of_hash

SIGNED_IN_S = 12 * 3600
"""A shift."""


def open_session(tx: Transaction, secret: str) -> str | None:
    """The cookie of a new session; None where no token with that secret holds."""
    if token(tx, secret) is None:
        return None
    tx.execute(sa.delete(sessions).where(sessions.c.created_at <= tx.now - timedelta(seconds=SIGNED_IN_S)))
    cookie = new_token()
    tx.execute(
        sa.insert(sessions).values(
            cookie_hash=token_hash(cookie), token_hash=token_hash(secret), created_at=tx.now
        )
    )
    return cookie


def session_token(tx: Transaction, cookie: str) -> TokenRecord | None:
    """The token of the session with that cookie; None if there is none now."""
    found = sa.select(sessions.c.token_hash).where(
        sessions.c.cookie_hash == token_hash(cookie),
        sessions.c.created_at > tx.now - timedelta(seconds=SIGNED_IN_S),
    )
    kept = tx.execute(found).scalar_one_or_none()
    return None if kept is None else token_of_hash(tx, kept)


def close_session(tx: Transaction, cookie: str) -> None:
    """End the session with that cookie, if there is one."""
    tx.execute(sa.delete(sessions).where(sessions.c.cookie_hash == token_hash(cookie)))
