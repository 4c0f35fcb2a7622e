"""Errors of the store, and checks for text that every database can hold."""

from __future__ import annotations

import re
from typing import Any

from glyphs.errors import MarksError

# longest serial, name of a part or of a person
MAX_TEXT = 200
# longest list given at once
MAX_ROWS = 10_000
# longest note of a review
MAX_NOTE = 4000

# no database holds NUL in a text, and UTF-8 has no half surrogates
_UNFIT = re.compile("[\x00\ud800-\udfff]")


class StoreError(MarksError):
    """The store cannot carry out the operation."""

    is_usage = False


class UnwritableError(StoreError):
    """The database answers, but takes no changes."""


class NotFoundError(StoreError):
    """Not found in the store."""


class ConflictError(StoreError):
    """The store has changed since the caller last read it."""


class ClaimedError(ConflictError):
    """Another person has claimed the part."""


class AlreadyDoneError(ConflictError):
    """A request with this idempotency key has made a part before; `fingerprint` is of that request."""

    def __init__(self, part_id: str, fingerprint: str) -> None:
        super().__init__(f"this idempotency key has made part {part_id} already", hint="ask for that part")
        self.part_id = part_id
        self.fingerprint = fingerprint


class UnfitError(StoreError):
    """A value that no store can hold or that makes no sense: the caller's mistake."""

    is_usage = True


def fit(text: str, what: str, *, limit: int = MAX_TEXT) -> str:
    """The text, if it can be stored. Raises UnfitError: it is too long, or has characters that no database holds."""
    if len(text) > limit:
        raise UnfitError(f"{what} has {len(text)} characters", hint=f"give at most {limit}")
    if _UNFIT.search(text):
        raise UnfitError(f"{what} has a NUL or a byte that is not UTF-8", hint="leave it out")
    return text


def cleaned(value: Any) -> Any:
    """Replace characters that databases cannot hold by U+FFFD in JSON values, for text that cannot be corrected."""
    if isinstance(value, str):
        return _UNFIT.sub("\ufffd", value)
    if isinstance(value, dict):
        return {cleaned(k): cleaned(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [cleaned(v) for v in value]
    return value
