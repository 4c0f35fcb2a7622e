"""Serial formats: which characters may stand where, and random serials that obey them."""

from __future__ import annotations

import string

import numpy as np

from glyphs.errors import MarksError

_CLASSES = {
    "A": string.ascii_uppercase,
    "9": string.digits,
    "*": string.ascii_uppercase + string.digits,
}


class FormatError(MarksError, ValueError):
    """A format that cannot be understood, or that no serial can meet. A ValueError, so that settings can be checked."""


def allowed_characters(format: str, *, exclude: str = "") -> tuple[str, ...]:
    """The characters allowed at each position.

    Args:
        format: `A` stands for A-Z, `9` for 0-9, `*` for either, any other character for itself.
        exclude: characters that `A`, `9` and `*` leave out (a VIN excludes "IOQ"); literals stay.

    Returns:
        One string of characters per position, in order.

    Raises:
        FormatError: the format is empty, holds a control character, or exclusion leaves a position without any.
    """
    if not format:
        raise FormatError(
            "the format is empty", hint="write one character a position: A letter, 9 digit, * either"
        )
    if not format.isprintable():
        raise FormatError(f"format {format!r} holds characters that cannot be printed", hint="remove them")
    allowed = tuple(
        "".join(c for c in _CLASSES[place] if c not in exclude) if place in _CLASSES else place
        for place in format
    )
    for k, characters in enumerate(allowed):
        if not characters:
            raise FormatError(
                f"nothing is left for {format[k]!r} at position {k + 1} of {format!r}",
                hint=f"exclude less than {exclude!r}",
            )
    return allowed


def random_text(format: str, *, rng: np.random.Generator, exclude: str = "") -> str:
    """A serial drawn evenly from all that obey the format.

    Args:
        format: as `allowed_characters`.
        rng: the only source of randomness.
        exclude: as `allowed_characters`.

    Raises:
        FormatError: as `allowed_characters`.
    """
    return "".join(c[int(rng.integers(len(c)))] for c in allowed_characters(format, exclude=exclude))
