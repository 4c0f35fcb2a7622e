r"""Regular expressions of Python's kind, as far as they say which characters follow each other, read into a tree.

    choice  = row | row | ...                     row  = part part ...
    part    = atom, perhaps with ? * + {m} {m,} {,n} {m,n} (and a ? behind, which changes nothing here)
    atom    = character, \character, \d \D \w \W \s \S, ., [set], [^set], (choice), (?:choice), (?P<name>choice)

Python's own parser is private, and greenery's does not know `\$`, takes `^` for a character and needs half a minute to
make a machine of `(A|B|C{2,9}){1,12}D`. Classes are ASCII: `\d` is 0-9.
"""

from __future__ import annotations

import re
import string
from dataclasses import dataclass
from functools import lru_cache

from glyphs.fonts.serials import FormatError

MOST_LENGTH = 500
"""Characters of an expression."""


@dataclass(frozen=True)
class Kind:
    """A kind of character.

    Attributes:
        chars: the characters.
        others: all but these are meant.
        written: characters that the expression names one by one, in a range or as `\\d`.
    """

    chars: frozenset[str]
    others: bool = False
    written: frozenset[str] = frozenset()

    def has(self, char: str) -> bool:
        """Whether a character is of this kind."""
        return (char in self.chars) != self.others

    def __or__(self, other: Kind) -> Kind:
        """Either kind."""
        written = self.written | other.written
        if self.others and other.others:
            return Kind(self.chars & other.chars, True, written)
        if self.others or other.others:
            wide, narrow = (self, other) if self.others else (other, self)
            return Kind(wide.chars - narrow.chars, True, written)
        return Kind(self.chars | other.chars, False, written)

    def __invert__(self) -> Kind:
        """The complement: all other characters, which the expression does not write out."""
        return Kind(self.chars, not self.others)


@dataclass(frozen=True)
class Repeated:
    """A part and how often it stands; `most` None is without end."""

    part: Kind | Choices
    least: int
    most: int | None


@dataclass(frozen=True)
class Choices:
    """Rows of parts, one of which stands."""

    rows: tuple[tuple[Repeated, ...], ...]

    def written(self) -> frozenset[str]:
        """All characters that are named, see `Kind.written`."""
        parts = [repeated.part for row in self.rows for repeated in row]
        return frozenset().union(*(p.written if isinstance(p, Kind) else p.written() for p in parts))


def _named_kind(chars: str) -> Kind:
    return Kind(frozenset(chars), written=frozenset(chars))


_FIGURE = _named_kind(string.digits)
_WORD = Kind(frozenset(string.ascii_letters + string.digits + "_"))
_BLANK = Kind(frozenset(string.whitespace))
_KINDS = {"d": _FIGURE, "D": ~_FIGURE, "w": _WORD, "W": ~_WORD, "s": _BLANK, "S": ~_BLANK}
_ANY = Kind(frozenset("\n"), others=True)
_REPEAT = re.compile(r"(?:(?P<sign>[?*+])|\{(?P<least>\d*)(?P<comma>,)?(?P<most>\d*)\})[?+]?")
_GROUP = re.compile(r"\((?:\?(?::|P<\w+>))?")


@lru_cache(maxsize=64)
def expression_tree(pattern: str) -> Choices:
    """The tree of an expression that must match a whole text; `^` in front and `$` at the end change nothing.

    Raises:
        FormatError: not a regular expression, or one that says more than which characters follow each other.
    """
    if not pattern or len(pattern) > MOST_LENGTH:
        raise FormatError(
            f"an expression has 1 to {MOST_LENGTH} characters", hint=f"this one has {len(pattern)}"
        )
    try:
        re.compile(pattern)
    except (re.error, OverflowError) as error:
        raise FormatError(f"{pattern!r} is not a regular expression: {error}") from error
    return _Parser(pattern).whole()


class _Parser:
    """Reads a pattern that Python has found good, so brackets are paired and ranges run forwards."""

    def __init__(self, pattern: str) -> None:
        self.text = pattern
        self.at = 1 if pattern.startswith("^") else 0

    def whole(self) -> Choices:
        choices = self.choices()
        if self.text[self.at :] not in ("", "$"):
            raise self._more_than_characters()
        return choices

    def choices(self) -> Choices:
        rows = [self.row()]
        while self._peek() == "|":
            self.at += 1
            rows.append(self.row())
        return Choices(tuple(rows))

    def row(self) -> tuple[Repeated, ...]:
        parts = []
        while self._peek() not in ("", "|", ")") and self.text[self.at :] != "$":
            part = self.atom()
            least, most = self.times()
            parts.append(Repeated(part, least, most))
        return tuple(parts)

    def atom(self) -> Kind | Choices:
        char = self._take()
        if char == "(":
            self.at = _GROUP.match(self.text, self.at - 1).end()  # type: ignore[union-attr]
            if self._peek() in "?*+":
                raise self._more_than_characters()
            inner = self.choices()
            if self._take() != ")":
                raise self._more_than_characters()
            return inner
        if char == "[":
            return self.set()
        if char == ".":
            return _ANY
        if char in "^$":
            raise self._more_than_characters()
        return self.escape() if char == "\\" else _named_kind(char)

    def set(self) -> Kind:
        invert = self._peek() == "^"
        self.at += invert
        found: Kind | None = None
        while self._peek() != "]" or found is None:
            one = self.member()
            if self._peek() == "-" and self.text[self.at + 1] != "]":
                self.at += 1
                ends = [ord(next(iter(end.chars))) for end in (one, self.member())]
                one = _named_kind("".join(map(chr, range(ends[0], ends[1] + 1))))
            found = one if found is None else found | one
        self.at += 1
        return ~found if invert else found

    def member(self) -> Kind:
        char = self._take()
        return self.escape() if char == "\\" else _named_kind(char)

    def escape(self) -> Kind:
        char = self._take()
        if char in _KINDS:
            return _KINDS[char]
        if char.isascii() and char.isalnum():
            raise self._more_than_characters()
        return _named_kind(char)

    def times(self) -> tuple[int, int | None]:
        match = _REPEAT.match(self.text, self.at)
        if match is None or match[0] in ("{}", "{}?"):
            return 1, 1
        self.at = match.end()
        if match["sign"]:
            return {"?": (0, 1), "*": (0, None), "+": (1, None)}[match["sign"]]
        least = int(match["least"] or 0)
        if not match["comma"]:
            return least, least
        return least, int(match["most"]) if match["most"] else None

    def _peek(self) -> str:
        return self.text[self.at : self.at + 1]

    def _take(self) -> str:
        self.at += 1
        return self.text[self.at - 1]

    def _more_than_characters(self) -> FormatError:
        return FormatError(
            f"{self.text!r} says more at character {self.at} than which characters follow each other; write it "
            r"with characters, [sets], \d, \w, ., |, (groups), ?, *, + and {m,n} only: no look-ahead, reference or "
            "option, and ^ and $ at the ends or not at all (the whole text is matched anyway)"
        )
