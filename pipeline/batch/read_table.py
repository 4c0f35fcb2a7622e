"""What was read, as a table on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pipeline.common.row import Row

if TYPE_CHECKING:
    from rich.text import Text

_RIGHT = ("confidence", "depth", "seconds")
_COLOUR = {
    "accept": "green",
    "review": "yellow",
    "reject": "red",
    "": "red",
    "confirmed": "green",
    "undecided": "yellow",
    "refuted": "red",
}


def print_table(rows: Sequence[Row]) -> None:
    """Print the rows."""
    from rich.console import Console
    from rich.table import Table

    verified = any(row.verdict for row in rows)
    shown = [_cells(row, verified=verified, graded=any(r.grade for r in rows)) for row in rows]
    # off a terminal nothing may be wrapped or cut: a script reads it
    widths = [sum(len(cell) + 2 for cell in cells.values()) for cells in shown]
    console = Console() if sys.stdout.isatty() else Console(width=max(120, *(80 + w for w in widths)))
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in shown[0]:
        table.add_column(heading, justify="right" if heading in _RIGHT else "left", overflow="fold")
    for cells in shown:
        table.add_row(*cells.values())
    console.print(table)


def _cells(row: Row, *, verified: bool, graded: bool) -> dict[str, Text]:
    """The cells of a row, by heading."""
    from rich.text import Text

    decision = row.decision or "error"
    cells = {
        "part": row.part,
        "text": row.text,
        "decision": decision,
        "confidence": "" if row.error else f"{row.confidence:.3f}",
        **({"verdict": row.verdict} if verified else {}),
        "depth": "" if row.depth_min_mm is None else f"{row.depth_min_mm:.3f}",
        **({"grade": row.grade} if graded else {}),
        "source": row.source,
        "seconds": f"{row.seconds:.2f}",
        "notes": row.error or notes(row),
    }
    coloured = {"decision": row.decision, "verdict": row.verdict}
    return {
        heading: Text(cell, style=_COLOUR.get(coloured[heading], "") if heading in coloured else "")
        for heading, cell in cells.items()
    }


def notes(row: Row) -> str:
    """What a person should know of a part that was read."""
    told = [row.flags]
    if not row.verdict:  # a verification names its places itself
        told.append(row.states)
    if row.verdict == "refuted":
        told.append(f"expected {row.expected}")
    if row.verdict == "undecided":
        told.append(f"{row.expected} with probability {row.verify_probability or 0.0:.3f}")
    if row.rivals and row.decision != "accept":
        told.append(f"or {row.rivals}")
    told.append(row.action)
    return "; ".join(part for part in told if part)
