"""Idempotency keys: a request that is sent again, or a run that is given again, is carried out once.

* A key is written in the transaction that writes the part it made: both are there, or neither.
* Of requests with one key that race, the database lets one through; the others wait for it and raise AlreadyDoneError.
* A key stands for one request: what it asked for is kept as its fingerprint, and whoever asks compares.
* Keys of requests are kept until `forget_keys`; a request sent again later than that makes a second part. Keys of runs
  are kept for good.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256

import sqlalchemy as sa

from pipeline.store.database import Transaction
from pipeline.store.errors import AlreadyDoneError, fit
from pipeline.store.tables import idempotency

_RUN = "run "
"""Beginning of the fingerprint of a run's part; those of requests are hexadecimal."""


@dataclass(frozen=True)
class IdempotencyKey:
    """How a request that is sent again is known.

    Attributes:
        key: of the request, with whose it is.
        fingerprint: of what it asks for: another one under the same key is another request.
    """

    key: str
    fingerprint: str


def run_key(run: str, part: str, sha256: str) -> IdempotencyKey:
    """The key of a part of a run.

    Args:
        run: hash of what the run's readings depend on.
        part: name of the part.
        sha256: of what its files hold.
    """
    return IdempotencyKey(f"run {run} {sha256} {part}", f"{_RUN}{sha256}")


def remembered(tx: Transaction, key: str) -> tuple[str, str] | None:
    """(fingerprint, part id) of the request with that idempotency key; None if there was none."""
    row = tx.execute(
        sa.select(idempotency.c.fingerprint, idempotency.c.part_id).where(
            idempotency.c.key_hash == _hash(key)
        )
    ).one_or_none()
    return None if row is None else (row.fingerprint, row.part_id)


def forget_keys(tx: Transaction, before: datetime) -> int:
    """Forget idempotency keys of requests of before a time, and say how many."""
    of_request = idempotency.c.fingerprint.not_like(f"{_RUN}%")
    return tx.execute(sa.delete(idempotency).where(idempotency.c.at < before, of_request)).rowcount


def refuse_if_done(tx: Transaction, asked: IdempotencyKey | None) -> None:
    """Let a request through that is new, or has no key.

    Raises:
        AlreadyDoneError: the key is taken.
    """
    done = None if asked is None else remembered(tx, asked.key)
    if done is not None:
        raise AlreadyDoneError(part_id=done[1], fingerprint=done[0])


def claim(tx: Transaction, asked: IdempotencyKey | None, part_id: str) -> None:
    """Take the key for a part.

    Raises:
        AlreadyDoneError: a racing request was quicker.
    """
    if asked is None:
        return
    row = {
        "key_hash": _hash(asked.key),
        "fingerprint": fit(asked.fingerprint, "the fingerprint"),
        "part_id": part_id,
        "at": tx.now,
    }
    # waits for a racing request with that key until it is known whether it has been done
    if not tx.insert_if_new(idempotency, row):
        refuse_if_done(tx, asked)


def _hash(key: str) -> str:
    return sha256(key.encode("utf-8", "surrogatepass")).hexdigest()
