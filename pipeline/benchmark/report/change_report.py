"""Report of two compared benchmarks: a page with pictures of changed readings, and a table of all changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.benchmark.analysis.changes import Change, Flip, changes
from pipeline.benchmark.analysis.groups import characters_right
from pipeline.benchmark.report.page import render, write_files
from pipeline.benchmark.report.worst_parts import WorstPart, draw_worst
from pipeline.benchmark.trials.journal import TrialJournal
from pipeline.benchmark.trials.run import remake
from pipeline.workers.executors import Executor, ordered_map

PAGE, DOCUMENT, TABLE = "compare.html", "compare.md", "compare.csv"
# flips that are drawn, the most serious first
SHOWN = 24
# levels that the document shows: those that changed most
_MOST_LEVELS = 8


def write_comparison(
    before: Path, after: Path, folder: Path, *, executor: Executor | None = None
) -> tuple[str, tuple[Path, ...]]:
    """Compare two folders of finished benchmarks, A and B, and write page and table. Returns the tables in Markdown and
    the paths. Raises FileError: a folder is not usable. NotComparableError: as in `changes`."""
    books = TrialJournal.read(before), TrialJournal.read(after)
    old, new = ([trial for trials in book.done.values() for trial in trials] for book in books)
    compared = changes(old, new, (books[0].description, books[1].description))
    drawn, problem = _drawn(books[1].description, compared.flips[:SHOWN], executor or Executor())
    folders = (str(before), str(after))
    values = {"changes": compared, "kinds": list(Flip), "problem": problem, "folders": folders}
    changed = [row for row in compared.by_factor if row.compared.characters.difference.value]
    changed.sort(key=lambda row: -abs(row.compared.characters.difference.value))
    document = render("compare.md.j2", **values, largest=changed[:_MOST_LEVELS])
    page = render(
        "compare.html.j2",
        **values,
        title="Comparison of two benchmarks",
        programs=tuple(str(book.description.get("program", "not known")) for book in books),
        drawn=drawn,
    )
    return document, write_files(folder, {PAGE: page, DOCUMENT: document, TABLE: _rows(compared.flips)})


def _drawn(
    description: Mapping[str, Any], flips: Sequence[Change], executor: Executor
) -> tuple[list[tuple[Change, WorstPart]], str]:
    blanks = [WorstPart((c.before, c.after), c.flip.value, c.after.given) for c in flips]
    problem = ""
    if blanks:
        try:
            benchmark, items = remake(description, (part.part for part in blanks))
        except MarksError as error:
            problem = str(error)
        else:
            # a part on which several readers flipped is drawn once
            once = {(blank.part, blank.given): (blank, items[blank.part]) for blank in blanks}
            pictures = ordered_map(executor, partial(draw_worst, benchmark), list(once.values()))
            by_part = dict(zip(once, pictures, strict=True))
            blanks = [by_part[blank.part, blank.given] for blank in blanks]
    return list(zip(flips, blanks, strict=True)), problem


def _rows(flips: Sequence[Change]) -> Iterator[Sequence[object]]:
    factors = list(dict.fromkeys(name for c in flips for name in c.after.levels))
    sides = ("text", "decision", "confidence", "characters_right")
    yield "part", *factors, "mode", "given", "flip", "truth", *(f"{s}_{ab}" for s in sides for ab in "ab")
    for c in flips:
        both = c.before, c.after
        yield (
            c.after.part, *(c.after.levels.get(name, "") for name in factors), c.after.mode, c.after.given,
            c.flip.value, c.after.truth, *(t.text for t in both), *(t.decision for t in both),
            *(t.confidence for t in both), *(characters_right(t) for t in both),
        )  # fmt: skip
