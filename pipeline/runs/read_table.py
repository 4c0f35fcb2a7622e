"""Table of the readings on the terminal: whole serials, with remarks on their own lines."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from glyphs.plain_text import visible
from pipeline.common.reading_records import CharacterRecord, ReadingRecord
from pipeline.common.row import row_of, state_text

_RIGHT = ("confidence", "depth mm", "seconds")
_SPARE = ("seconds", "source", "depth mm", "grade", "confidence")
"""Columns that a narrow terminal leaves out, in this order."""
_COLOUR = {
    **dict.fromkeys(("accept", "confirmed"), "green"),
    **dict.fromkeys(("review", "undecided"), "yellow"),
    **dict.fromkeys(("reject", "error", "refuted"), "red"),
}
_GAP = "  "
_LEAST_WIDTH = 20
_USUAL_NAME = 16


def print_table(records: Sequence[ReadingRecord]) -> None:
    """Print one row per part: fitted to the width of a terminal, in full if the output is not one."""
    console = Console(soft_wrap=True, highlight=False, markup=False, emoji=False)
    for line in table_lines(records, width=max(_LEAST_WIDTH, console.width) if console.is_terminal else None):
        text = Text(line)
        # colour the program's own words, which two blanks separate from texts that were read
        for word, colour in _COLOUR.items():
            text.highlight_regex(rf"(?<=  ){word}(?=  |$)", colour)
        console.print(text)


def table_lines(records: Sequence[ReadingRecord], *, width: int | None) -> list[str]:
    """Lay out the table for a terminal of so many columns; None: as many as are needed."""
    cells = [_cells(record) for record in records]
    # leave out columns that are empty for all parts, except those that everybody looks for
    shown = [h for h in cells[0] if h in ("part", "text", "decision") or any(c[h] for c in cells)]
    widths = {h: max(cell_len(h), *(cell_len(c[h]) for c in cells)) for h in shown}
    if width is not None:
        shown = _fitting(shown, widths, width)
        # a name too long for its column has its own line above its row
        room = width - _total(shown, {**widths, "part": 0})
        fitting = [n for c in cells if (n := cell_len(c["part"])) <= room]
        widths["part"] = max(cell_len("part"), *fitting, 0)

    def line(cells: Mapping[str, str]) -> str:
        blanks = {h: " " * (widths[h] - cell_len(cells[h])) for h in shown}
        filled = (blanks[h] + cells[h] if h in _RIGHT else cells[h] + blanks[h] for h in shown)
        return _GAP.join(filled).rstrip()

    remark = textwrap.TextWrapper(
        width or 0,
        initial_indent=_GAP,
        subsequent_indent=2 * _GAP,
        break_on_hyphens=False,
        break_long_words=False,
    )
    lines = [line({h: h for h in shown})]
    for record, cell in zip(records, cells, strict=True):
        if cell_len(cell["part"]) > widths["part"]:
            lines.append(cell["part"])
            cell["part"] = ""
        lines.append(line(cell))
        if remarks := visible(" ".join((record.error or notes(record)).split())):
            lines += [f"{_GAP}{remarks}"] if width is None else remark.wrap(remarks)
    return lines


def _fitting(headings: Sequence[str], widths: Mapping[str, int], width: int) -> list[str]:
    least = {**widths, "part": min(widths["part"], _USUAL_NAME)}
    for count in range(len(_SPARE) + 1):
        shown = [h for h in headings if h not in _SPARE[:count]]
        if _total(shown, least) <= width:
            break
    return shown


def _total(headings: Sequence[str], widths: Mapping[str, int]) -> int:
    return sum(widths[h] for h in headings) + len(_GAP) * (len(headings) - 1)


def _cells(record: ReadingRecord) -> dict[str, str]:
    row = row_of(record)
    return {
        "part": visible(record.part),
        "text": visible(record.text),
        "lines": visible(row["lines"]),
        "decision": record.decision or "error",
        "confidence": "" if record.error else f"{record.confidence:.3f}",
        "verdict": record.verdict,
        "depth mm": "" if row["depth_min_mm"] is None else f"{row['depth_min_mm']:.3f}{_share(record)}",
        "grade": row["grade"],
        "source": record.source,
        "seconds": f"{record.seconds:.2f}",
    }


def _share(record: ReadingRecord) -> str:
    measured, places = sum(c.depth_min_mm is not None for c in record.characters), len(record.characters)
    return f" ({measured}/{places})" if measured < places else ""


def notes(record: ReadingRecord) -> str:
    """Notes on a reading, in words."""
    messages = list(record.messages)
    if not record.verdict:  # a verification names its own places
        # do not repeat places that the messages name
        places = {k for reason in record.reasons for k in reason.places}
        states = (
            f"place {k}: {_state(c)}"
            for k, c in enumerate(record.characters, start=1)
            if c.state not in ("", "read") and k not in places
        )
        messages.append(", ".join(states))
    row = row_of(record)
    if record.verdict == "refuted":
        messages.append(f"expected {record.expected}")
    if record.verdict == "undecided":
        messages.append(f"{record.expected} with probability {record.verify_probability or 0.0:.3f}")
    if record.rivals and record.decision != "accept":
        messages.append(f"may also be {row['rivals']}")
    messages.append(row["action"])
    return "; ".join(part for part in messages if part)


def _state(place: CharacterRecord) -> str:
    chars = [char or "-" for char in place.state_chars]
    if place.state == "confused":
        return f"{' or '.join(chars)}?"
    if place.state == "mismatch":
        return " where ".join(chars) + " is expected"
    return state_text(place.state, chars)
