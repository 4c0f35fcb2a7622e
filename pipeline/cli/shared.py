"""Types of flags, tables and pictures that several commands share.

Some flags repeat the values of enums that are too slow to import for help. Tables are 80 columns wide if the output is
not a terminal.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console


FidelityName = Literal["pointwise", "contact"]
SensorsName = Literal["real", "ideal"]
Flag = Annotated[bool, Parameter(negative="")]  # without a negative form (default: off)
Positive = Annotated[int | None, Parameter(validator=Number(gte=1))]
Speed = Annotated[float | None, Parameter(validator=Number(gt=0, lte=1000))]
Jobs = Annotated[int, Parameter(validator=Number(gte=1))]


COLUMNS = 80


def print_table(
    headings: Sequence[str], rows: Iterable[Iterable[object]], words: Collection[str] = ()
) -> None:
    """Print a table without rules; columns of `words` are left-aligned and wrapped if needed."""
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
    _console().print(table)


def print_document(text: str, written: Iterable[Path] = ()) -> None:
    """Print tables in Markdown, and the files that hold them."""
    from rich.markdown import Markdown

    _console().print(Markdown(text))
    for path in written:
        print(f"wrote {path}")


def _console() -> Console:
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=COLUMNS)


def write_picture(figure: Figure, path: Path) -> None:
    """Write a picture, and print its path. Raises FileError: it cannot be written."""
    from pipeline.plots.pictures import save_figure

    save_figure(figure, path)
    print(f"wrote {path}")
