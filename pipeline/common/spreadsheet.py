"""Cells of CSV that a spreadsheet takes for formulas: with an apostrophe in front they are text there, too.

=1+1   -->   '=1+1   -->   =1+1            -A7 --> '-A7            'x, plain text --> 'x
"""

from __future__ import annotations

import re

_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def harmless(text: str) -> str:
    """A cell's text as it is written."""
    return f"'{text}" if _FORMULA.match(text) else text


def original(cell: str) -> str:
    """The text of a cell that was written so."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell
