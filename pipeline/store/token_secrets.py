"""Secrets of callers: made here, kept as their hash alone."""

from __future__ import annotations

import secrets
from hashlib import sha256

PREFIX = "tm_"


def new_token() -> str:
    """A secret of 256 random bits; by its beginning programs find leaked ones."""
    return PREFIX + secrets.token_urlsafe(32)


def token_hash(secret: str) -> str:
    """What is kept of a secret: its SHA-256. It needs no salt, for nobody can guess 256 random bits."""
    return sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
