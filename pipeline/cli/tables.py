"""Tables that commands print, 80 columns wide if the output is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Sequence

COLUMNS = 80


def print_table(
    headings: Sequence[str], rows: Iterable[Iterable[object]], words: Collection[str] = ()
) -> None:
    """Print a table without rules.

    Args:
        headings: of the columns.
        rows: cells of each row.
        words: headings of columns that hold words: they stand on the left, and are wrapped if needed.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, header_style="bold")
    for heading in headings:
        wordy = heading in words
        table.add_column(
            heading, justify="left" if wordy else "right", no_wrap=not wordy and " " not in heading,
            overflow="fold" if wordy else "ellipsis",
        )  # fmt: skip
    for row in rows:
        table.add_row(*map(str, row))
    (Console() if sys.stdout.isatty() else Console(width=COLUMNS)).print(table)
