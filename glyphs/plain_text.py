"""Make text safe to show: no control characters, no terminal escapes, no marks that reverse the text after them."""

from __future__ import annotations

import re
import unicodedata

_HIDDEN_KINDS = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
_NOT_PLAIN_ASCII = re.compile(r"[^\x20-\x7e]")


def is_hidden(char: str) -> bool:
    """Whether a character is not visible text: control, format, surrogate, unassigned, line separator."""
    return unicodedata.category(char) in _HIDDEN_KINDS


def visible(text: str) -> str:
    """The text with its hidden characters written as escapes: \\x1b, \\u202e."""

    def escaped(match: re.Match[str]) -> str:
        char = match[0]
        return char.encode("unicode_escape").decode() if is_hidden(char) else char

    return _NOT_PLAIN_ASCII.sub(escaped, text)
