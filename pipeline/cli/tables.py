"""Tables that commands print, 80 columns wide if the output is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

COLUMNS = 80


def screen() -> Console:
    """Console, 80 columns wide if the output is not a terminal."""
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=COLUMNS)


def plain_table(headings: Sequence[str], left: Sequence[str]) -> Table:
    """Table without rules; columns named in `left` hold words and are wrapped if needed."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, header_style="bold")
    for heading in headings:
        words = heading in left
        table.add_column(
            heading, justify="left" if words else "right", no_wrap=not words and " " not in heading,
            overflow="fold" if words else "ellipsis",
        )  # fmt: skip
    return table
