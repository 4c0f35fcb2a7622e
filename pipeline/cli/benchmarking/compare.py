"""`tactile-marks benchmark compare`: what a change did, part by part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.benchmark.analysis.changes import Row
    from pipeline.benchmark.report.change_report import Compared

_MOST_ROWS = 8


def compare(
    before: Path, after: Path, /, *, out: Path | None = None, pictures: int = 24, jobs: int = 1
) -> int:
    """Compare two finished benchmarks of the same parts, and show what flipped.

    Writes compare.html, with pictures of the parts that flipped, and compare.csv.

    Parameters
    ----------
    before
        Folder of the benchmark before the change (its --out).
    after
        Folder of the benchmark after it.
    out
        Folder for the page and the table; that of the second benchmark unless given.
    pictures
        How many flips are drawn at most, the gravest first.
    jobs
        Worker processes that draw.
    """
    with failures_reported():
        if jobs < 1 or pictures < 0:
            raise CommandError("compare: --jobs is at least 1, --pictures at least 0", status=USAGE)
        from pipeline.benchmark.report.change_report import write_comparison
        from pipeline.workers.options import ExecutorOptions

        with ExecutorOptions(jobs).opened(pictures) as executor:
            written = write_comparison(before, after, out or after, pictures=pictures, executor=executor)
    _print(written)
    return 0


def _print(written: Compared) -> None:
    from pipeline.benchmark.analysis.changes import Flip
    from pipeline.cli.benchmarking.result import plain_table, screen

    found = written.changes
    print(f"{found.parts} parts, B less A; characters in percentage points")
    _print_rows(found.overall, of=False)
    largest = sorted(found.by_factor, key=lambda row: -abs(row.compared.characters.difference))
    if shown := [row for row in largest if row.compared.characters.difference][:_MOST_ROWS]:
        print("\nlargest by factor")
        _print_rows(shown, of=True)
    if found.flips:
        print("\nreadings that flipped")
        table = plain_table(("reader", *(flip.name.lower().replace("_", " ") for flip in Flip)), ("reader",))
        for reader, counts in found.counts.items():
            table.add_row(reader, *(str(counts[flip]) for flip in Flip))
        screen().print(table)
        for flip in Flip:
            print(f"{flip.name.lower().replace('_', ' ')}: {flip.value}")
    else:
        print("nothing flipped")
    if found.left_out:
        print(f"only in one of them, not compared: {'; '.join(found.left_out)}")
    if written.problem:
        print(f"no pictures: {written.problem}")
    for path in (written.page, written.table):
        print(f"wrote {path}")


def _print_rows(rows: Sequence[Row], *, of: bool) -> None:
    from pipeline.benchmark.analysis.changes import level_words
    from pipeline.benchmark.report.page import points
    from pipeline.cli.benchmarking.result import plain_table, screen

    words = ("reader", "of") if of else ("reader",)
    table = plain_table((*words, "parts", "chars", "95 %", "gained", "lost", "p"), words)
    for row in rows:
        c = row.compared
        table.add_row(
            c.first.reader, *([level_words(row)] if of else []), str(c.parts), points(c.characters.difference),
            f"{points(c.characters.low)} to {points(c.characters.high)}", str(c.serials.only_first),
            str(c.serials.only_second), f"{c.serials.p_differ:.3f}",
        )  # fmt: skip
    screen().print(table)
