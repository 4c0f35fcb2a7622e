"""Errors of stamping, and the choice of a named practice, die, plate or layout."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from glyphs.errors import MarksError

_Named = TypeVar("_Named")


class StampError(MarksError):
    """A part that cannot be stamped: the message gives the wrong number or name, and its range or choices."""


def pick(kind: str, choices: Mapping[str, _Named], name: str) -> _Named:
    """Return the choice with a name. Raises StampError: there is no such choice; the message lists all of them."""
    try:
        return choices[name]
    except KeyError:
        raise StampError(f"there is no {kind} {name!r}", hint=f"use one of {', '.join(choices)}") from None
