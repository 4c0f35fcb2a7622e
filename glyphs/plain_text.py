"""Make text safe to show: no control characters, no terminal escapes, no marks that reverse the text after them."""

from __future__ import annotations

import re
import unicodedata

_HIDDEN_KINDS = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
# fillers, joiners and selectors that are not drawn, though Unicode counts them as letters or marks; a blank of Braille
_NOT_DRAWN = frozenset(
    map(
        chr,
        (
            *(0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x180B, 0x180C, 0x180D, 0x180F, 0x2800, 0x3164, 0xFFA0),
            *range(0xFE00, 0xFE10),
            *range(0xE0100, 0xE01F0),
        ),
    )
)
_NOT_PLAIN_ASCII = re.compile(r"[^\x20-\x7e]")


def is_hidden(char: str) -> bool:
    """Whether a character is not visible text: control, format, surrogate, unassigned, line separator, filler."""
    return unicodedata.category(char) in _HIDDEN_KINDS or char in _NOT_DRAWN


def has_hidden(text: str) -> bool:
    """Whether a text has a hidden character."""
    return any(map(is_hidden, _NOT_PLAIN_ASCII.findall(text)))


def visible(text: str) -> str:
    """The text with its hidden characters written as escapes: \\x1b, \\u202e."""

    def escaped(match: re.Match[str]) -> str:
        char = match[0]
        return char.encode("unicode_escape").decode() if is_hidden(char) else char

    return _NOT_PLAIN_ASCII.sub(escaped, text)
