"""A reading as a small table for notebooks: one column a character."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recognition import CharacterReading

_CELL = "text-align:center;padding:1px 8px"


def table_html(
    headline: str,
    characters: Sequence[CharacterReading],
    messages: Sequence[str],
    *,
    most_alternatives: int = 2,
) -> str:
    """The reading in one line over its characters, their confidence and alternatives, and what to know about it."""
    rows = {
        "character": [f"<b style='font-size:150%'>{escape(c.char)}</b>" for c in characters],
        "confidence": [f"{c.confidence:.3f}" for c in characters],
        "or": [
            "<br>".join(
                f"{escape(o.char)} {o.probability:.3f}" for o in c.candidates[1 : most_alternatives + 1]
            )
            for c in characters
        ],
    }
    body = "".join(
        f"<tr><th style='{_CELL}'>{name}</th>{''.join(f'<td style={_CELL!r}>{v}</td>' for v in cells)}</tr>"
        for name, cells in rows.items()
        if cells
    )
    notes = "".join(f"<li>{escape(message)}</li>" for message in messages)
    return f"<div><p>{escape(headline)}</p><table>{body}</table><ul>{notes}</ul></div>"
