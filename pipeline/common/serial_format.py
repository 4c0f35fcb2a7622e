"""The grammar of serials from the settings: formats and a lexicon."""

from __future__ import annotations

import re
from pathlib import Path
from string import ascii_lowercase, ascii_uppercase, digits

from glyphs.fonts.serials import FormatError
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.common.texts import without_blanks
from pipeline.errors import DataError, reading
from recognition.language.grammar import Grammar

_MAX_FILE_BYTES = 20_000_000
_COMMENT = re.compile(r"(^|\s)#.*")


def serial_format(settings: ReadSettings) -> Grammar | None:
    """The grammar of the serials, if any. Raises FileError: no such lexicon. SettingsError: contradicting settings."""
    words = None if settings.lexicon is None else read_lexicon(settings.lexicon)
    if not settings.format and words is None:
        return None
    try:
        return Grammar.parse(*settings.format, lexicon=words)
    except FormatError as error:
        keys = [key for key in ("format", "lexicon") if getattr(settings, key)]
        raise SettingsError(f"{' and '.join(keys)} cannot be met: {error.what}", hint=error.hint) from error


def outside_format(text: str, settings: ReadSettings) -> str:
    """The rules that a text breaks, in words; empty if there are none. Errors as in `serial_format`."""
    grammar = serial_format(settings)
    objections = () if grammar is None or not text else grammar.objections(text)
    return "; ".join(objections)


def read_lexicon(path: Path) -> frozenset[str]:
    """The serials in a text file, one per line; a # at the start or after a blank begins a comment."""
    with reading(path, most_bytes=_MAX_FILE_BYTES):
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise DataError("is not UTF-8 text", "save it as text (UTF-8), one serial per line") from error
        words = frozenset(without_blanks(_COMMENT.sub("", line)) for line in lines) - {""}
        if not words:
            raise DataError("holds no serial", "write one per line")
        if odd := next((word for word in sorted(words) if not word.isprintable()), ""):
            raise DataError(f"holds {odd!r}", "write printable serials, one per line")
    return words


def format_like(text: str) -> str:
    """The format that a text suggests, AA999999 for KX407251, Aaa-99 for Lot-07: any letters and digits."""
    return "".join(_like(char) for char in " ".join(text.split()))


def _like(char: str) -> str:
    if char in ascii_uppercase:
        return "A"
    if char in ascii_lowercase:
        return "a"
    # characters with a meaning in a mask are escaped
    return "9" if char in digits else f"\\{char}" if char in "*\\?[]{}|^$+" else char
