"""Texts: stamped form, cells of a table, and alignment of a true serial with the one that was read.

Cells of CSV that a spreadsheet takes for formulas are text with an apostrophe in front: =1+1 <-> '=1+1.

Serials of equal length are compared place by place. Others are aligned with the fewest edits (Levenshtein), with EXTRA
or MISSING beside a character that has no partner::

    true   A B 1 2 3             true   A B 1 2 3
    read   A 8 1 2 3             read   A   1 2 3 7
                                        MISSING   EXTRA
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

# beginnings that spreadsheets take for formulas; East Asian editions also accept the full-width signs
_FORMULA = re.compile(r"'*[=+\-@\t\r\n＝＋－＠]")
MISSING = "nothing"
"""Stands for the missing reading of a stamped character."""
EXTRA = "nothing stamped"
"""Stands for the missing stamped character of a reading."""


def without_blanks(text: str) -> str:
    """A text without blanks, as it is stamped."""
    return "".join(text.split())


def same_text(one: str, other: str) -> bool:
    """Whether two serials are the same; spaces are not stamped."""
    return without_blanks(one) == without_blanks(other)


def split_commas(text: str) -> tuple[str, ...]:
    """Split items separated by commas."""
    return tuple(item.strip() for item in text.split(",") if item.strip())


def first_of(names: Sequence[str]) -> str:
    """Join the first five names; "..." stands for the others."""
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")


def escape_formula(text: str) -> str:
    """A text for a cell, marked with an apostrophe if a spreadsheet would take it for a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def unescape_formula(cell: str) -> str:
    """Recover the text from a cell that `escape_formula` has made."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


@dataclass(frozen=True)
class Pair:
    """A place of the alignment.

    Attributes:
        true: character stamped, or EXTRA.
        read: character read, or MISSING.
        place: index of the character read, from 0; None if none was.
    """

    true: str
    read: str
    place: int | None

    @property
    def right(self) -> bool:
        """Whether it was read as it was stamped."""
        return self.true == self.read


def align(true: str, read: str) -> tuple[Pair, ...]:
    """Align two serials, left to right."""
    if len(true) == len(read):
        return tuple(Pair(t, r, k) for k, (t, r) in enumerate(zip(true, read, strict=True)))
    from rapidfuzz.distance import Levenshtein  # slow to import, and every command imports this module

    pairs: list[Pair] = []
    for step in Levenshtein.opcodes(true, read):
        if step.tag == "delete":
            pairs += [Pair(c, MISSING, None) for c in true[step.src_start : step.src_end]]
        elif step.tag == "insert":
            pairs += [Pair(EXTRA, read[k], k) for k in range(step.dest_start, step.dest_end)]
        else:
            there = range(step.src_start, step.src_end), range(step.dest_start, step.dest_end)
            pairs += [Pair(true[i], read[k], k) for i, k in zip(*there, strict=True)]
    return tuple(pairs)
