"""`tactile-marks read`: parts in, a table of serials out."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from pipeline.failing import USAGE, CommandError, failures_told

if TYPE_CHECKING:
    from pipeline.batch import Row

Mode = Literal["tactile"]
FidelityName = Literal["pointwise", "contact"]


def read(
    *inputs: str,
    font: Annotated[list[str] | None, Parameter(negative="")] = None,
    format: str | None = None,
    height_mm: float | None = None,
    mode: Mode | None = None,
    fidelity: FidelityName | None = None,
    database: Path | None = None,
    depth_rule: str | None = None,
    min_depth_mm: float | None = None,
    truth: Path | None = None,
    out: Path | None = None,
    config: Path | None = None,
) -> int:
    """Read the serials of parts: height maps (.npz, .x3p, .sdf, .sur ...), scans (.h5), folders or globs.

    Files of one stem are one part. The exit status is 1 if any part could not be read.

    Parameters
    ----------
    inputs
        Files, folders or globs.
    font
        Built-in name or TTF/OTF file; may be repeated. Without it every built-in font competes.
    format
        Mask of the serial: A letter, 9 digit, * either, any other character itself.
    height_mm
        Character height in mm; found out if not given.
    mode
        Sense that reads.
    fidelity
        How touch is simulated.
    database
        Glyph database to take the fonts from.
    depth_rule
        Rule that the marks must meet, such as 27CFR478.92; parts that do not are told, the text is read alike.
    min_depth_mm
        Depth in mm that the marks must have everywhere; told alike.
    truth
        CSV with the columns part and text; prints the accuracy.
    out
        Table to write: .csv, .jsonl or .parquet.
    config
        TOML file with settings; tactile-marks.toml in the working folder is read by itself.
    """
    from pipeline.batch import read_parts
    from pipeline.parts import discover
    from pipeline.readers import open_reader
    from pipeline.settings import load_settings
    from pipeline.tables import check_output, write_rows
    from pipeline.truth import load_truth, score

    if not inputs:
        raise CommandError("read: name a height map, a scan, a folder or a glob", status=USAGE)
    with failures_told():
        settings = load_settings(
            config=config,
            font=tuple(font) if font else None,
            format=format,
            height_mm=height_mm,
            mode=mode,
            fidelity=fidelity,
            database=database,
            depth_rule=depth_rule,
            min_depth_mm=min_depth_mm,
        )
        if out is not None:
            check_output(out)
        stamped = load_truth(truth) if truth is not None else None
        parts = discover(inputs)
        reader = open_reader(settings)
        with _progress(len(parts)) as advance:
            rows = read_parts(parts, reader, on_row=advance)
        _print_table(rows)
        if out is not None:
            write_rows(rows, out)
            print(f"wrote {out}")
        if stamped is not None:
            print(score(rows, stamped).describe())
    return 1 if any(row.error for row in rows) else 0


class _Progress:
    """A bar on the terminal; called with every row."""

    def __init__(self, total: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("reading"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task = self._bar.add_task("reading", total=total)

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def __call__(self, _: Row) -> None:
        self._bar.advance(self._task)


def _progress(total: int) -> AbstractContextManager[Any]:
    return _Progress(total) if total > 1 and sys.stderr.isatty() else nullcontext()


def _print_table(rows: Sequence[Row]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    # off a terminal nothing may be wrapped or cut: a script reads it
    console = Console() if sys.stdout.isatty() else Console(width=max(120, *(_width(r) for r in rows)))
    table = Table(box=None, pad_edge=False, header_style="bold")
    figures = ("confidence", "depth", "seconds")
    for heading in ("part", "text", "decision", "confidence", "depth", "source", "seconds", "notes"):
        table.add_column(heading, justify="right" if heading in figures else "left", overflow="fold")
    colour = {"accept": "green", "review": "yellow", "reject": "red", "": "red"}
    for row in rows:
        table.add_row(
            Text(row.part),
            Text(row.text),
            Text(row.decision or "error", style=colour[row.decision]),
            "" if row.error else f"{row.confidence:.3f}",
            "" if row.depth_min_mm is None else f"{row.depth_min_mm:.3f}",
            row.source,
            f"{row.seconds:.2f}",
            Text(row.error or row.flags),
        )
    console.print(table)
    wrong = sum(bool(row.error) for row in rows)
    if len(rows) > 1:
        told = [
            f"{n} {d}" for d in ("accept", "review", "reject") if (n := sum(r.decision == d for r in rows))
        ]
        print(", ".join([f"{len(rows)} parts", *told, *([f"{wrong} with an error"] if wrong else [])]))


def _width(row: Row) -> int:
    return len(row.part) + len(row.text) + len(row.error or row.flags) + 68
