"""Serial formats: the characters allowed at each position, and random serials that follow a format."""

from __future__ import annotations

import re
import string

import numpy as np

from glyphs.errors import MarksError

SIGNS = "-./#()&"
"""Punctuation used in part markings."""
_OPERATORS = "?[]{}|^$+"
"""Operators of regular expressions; no die has these characters, so a mask must not contain them."""
_CLASSES = {
    "A": string.ascii_uppercase,
    "a": string.ascii_lowercase,
    "9": string.digits,
    "*": string.ascii_uppercase + string.digits,
}


class FormatError(MarksError, ValueError):
    """A format that is invalid, or that no serial can match. It is a ValueError, so that pydantic can report it."""


def allowed_characters(format: str, *, exclude: str = "") -> tuple[str, ...]:
    r"""The characters allowed at each position, one string for each. Raises FormatError.

    Args:
        format: `A` stands for A-Z, `a` for a-z, `9` for 0-9, `*` for A-Z and 0-9, any other character but
            `?[]{}|^$+` for itself; `\` makes the next character stand for itself (`\A` is an A).
        exclude: characters that the classes leave out (a VIN excludes "IOQ"); literals stay.
    """
    if not format:
        raise FormatError(
            "the format is empty",
            hint="write one character per position: A for a capital, a for a small letter, 9 for a digit, * for A or 9",
        )
    if not format.isprintable():
        raise FormatError(f"format {format!r} holds characters that cannot be printed", hint="remove them")
    # a token is a class, a literal, or an escaped literal
    tokens = re.findall(r"\\.|.", format)
    if tokens[-1] == "\\":
        raise FormatError(
            f"nothing follows the backslash that ends {format!r}", hint="write \\\\ for a backslash"
        )
    allowed = tuple(
        "".join(c for c in _CLASSES[token] if c not in exclude) if token in _CLASSES else token[-1]
        for token in tokens
    )
    for k, (token, characters) in enumerate(zip(tokens, allowed, strict=True)):
        if len(token) == 1 and token in _OPERATORS:
            raise FormatError(
                f"{token!r} at position {k + 1} of {format!r} has no meaning in a mask",
                hint=f"write * for a letter or a digit, \\{token} for the character itself, or "
                "re:[A-Z]{2}[0-9]{1,2} for serials of several lengths",
            )
        if not characters:
            raise FormatError(
                f"no character is left for {tokens[k]!r} at position {k + 1} of {format!r}",
                hint=f"exclude fewer characters than {exclude!r}",
            )
    return allowed


def random_text(format: str, *, rng: np.random.Generator, exclude: str = "") -> str:
    """Draw a serial that matches a format (see `allowed_characters`) at random, each as likely as the next."""
    return "".join(c[int(rng.integers(len(c)))] for c in allowed_characters(format, exclude=exclude))
