"""Form and comparison of the names of parts and people: composed and decomposed letters, full-width and plain ones
(NFKC) and both cases are the same. Hidden characters are refused, or replaced in names of files."""

from __future__ import annotations

import unicodedata

from glyphs.errors import MarksError
from glyphs.plain_text import has_hidden, is_hidden


class HiddenCharacterError(MarksError):
    """A text with control characters or other characters that cannot be seen."""


def check_visible(text: str) -> str:
    """Return the text if it has no hidden character. Raises HiddenCharacterError: it has some."""
    if has_hidden(text):
        what = f"{text[:80]!a} has a character that cannot be seen"
        raise HiddenCharacterError(what, hint="type it again without it")
    return text


def clean_name(name: str) -> str:
    """Normalise a name, with single blanks between words. Raises HiddenCharacterError: it has hidden characters."""
    return " ".join(unicodedata.normalize("NFKC", check_visible(name)).split())


def printable_name(name: str) -> str:
    """Normalise a name, with an underscore in place of each hidden character."""
    return clean_name("".join("_" if is_hidden(char) else char for char in name))


def folded(name: str) -> str:
    """A key that is the same for all spellings of a name."""
    visible = "".join(char for char in name if not is_hidden(char))
    key = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", visible).casefold())
    return " ".join(key.split())
