"""Texts: stamped form, cells of a table, and alignment of a true serial with the one that was read.

Cells of CSV are quoted, and text that a spreadsheet would take for a formula has an apostrophe in front, also where one
of another country splits a cell: =1+1 <-> '=1+1, x;=1 <-> x;'=1.

Serials of other lengths are aligned with the fewest edits (Levenshtein), EXTRA or MISSING beside what has no partner.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

INVISIBLE = "\u200b\u200e\u200f\u2060\ufeff"
"""Marks of direction and of byte order, and spaces without width."""
# start of a cell, or of a piece that another delimiter makes of it, that spreadsheets take for a formula; blanks before
# the sign are ignored, and East Asian editions also accept the full-width signs
_FORMULA = r"(?:^|(?<=[;|\t\r\n])){}(?=['\"\s" + INVISIBLE + r"]*[=+\-@\t\r\n＝＋－＠])"
_BARE, _MARKED = re.compile(_FORMULA.format("")), re.compile(_FORMULA.format("'"))
CSV_BEGIN = "\ufeff"  # the byte order mark, without which Excel does not read a CSV file as UTF-8
MISSING = "nothing"  # stands for the missing reading of a stamped character
EXTRA = "nothing stamped"  # stands for the missing stamped character of a reading


def without_blanks(text: str) -> str:
    """A text without blanks, as it is stamped."""
    return "".join(text.split())


def same_text(text: str, other: str) -> bool:
    """Whether two serials are the same; spaces are not stamped."""
    return without_blanks(text) == without_blanks(other)


def split_commas(text: str) -> tuple[str, ...]:
    """Split items separated by commas."""
    return tuple(item.strip() for item in text.split(",") if item.strip())


def first_of(names: Sequence[str], most: int = 5) -> str:
    """Join the first names, and count the others."""
    more = f" and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def csv_line(cells: Iterable[object]) -> str:
    """A line of a CSV table with its line end; None is an empty cell."""
    marked = [_BARE.sub("'", cell) if isinstance(cell, str) else cell for cell in cells]
    line = io.StringIO()
    csv.writer(line, quoting=csv.QUOTE_ALL).writerow(marked)
    return line.getvalue()


def unescape_formula(cell: str) -> str:
    """Recover the text from a cell that `csv_line` has written."""
    return _MARKED.sub("", cell) if "'" in cell else cell


@dataclass(frozen=True)
class Pair:
    """A place of the alignment: the character stamped, or EXTRA, and the one read with its index, or MISSING."""

    true: str
    read: str
    place: int | None

    @property
    def right(self) -> bool:
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
