"""What cannot be stamped, and how amounts and names are checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import TypeVar

from glyphs.errors import MarksError

_Named = TypeVar("_Named")


class StampError(MarksError):
    """What cannot be stamped so: the message names the amount or name and what it may be."""


def check_amounts(values: object, *, positive: tuple[str, ...] = (), signed: tuple[str, ...] = ()) -> None:
    """Check every float field of a dataclass: finite, at least zero unless `signed`, above it if `positive`.

    Raises:
        StampError: a field out of range.
    """
    for item in fields(values):  # type: ignore[arg-type]
        value = getattr(values, item.name)
        if not isinstance(value, (int, float)):
            continue
        if not math.isfinite(value):
            raise StampError(f"{item.name} is {value}", hint="it must be finite")
        if item.name in positive and value <= 0.0:
            raise StampError(f"{item.name} is {value}", hint="it must be positive")
        if item.name not in signed and value < 0.0:
            raise StampError(f"{item.name} is {value}", hint="it must be zero or positive")


def check_shares(values: object, *names: str, what: str = "a fraction") -> None:
    """Refuse a field above 1, with a StampError that says what it is."""
    for name in names:
        if getattr(values, name) > 1.0:
            raise StampError(f"{name} is {getattr(values, name)}", hint=f"it is {what} between 0 and 1")


def chosen(kind: str, choices: Mapping[str, _Named], name: str) -> _Named:
    """The choice of that name.

    Raises:
        StampError: there is none; the message names all.
    """
    try:
        return choices[name]
    except KeyError:
        raise StampError(f"there is no {kind} {name!r}", hint=f"use one of {', '.join(choices)}") from None
