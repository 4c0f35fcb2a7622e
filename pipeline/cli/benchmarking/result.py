"""What a finished benchmark prints: at most 80 columns."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from pipeline.benchmark.analysis.groups import Group
    from pipeline.benchmark.analysis.statistics import Statistics
    from pipeline.benchmark.report.writing import Written

COLUMNS = 80
_MOST_ROWS = 24
_MOST_FACTORS = 6


def print_result(written: Written) -> None:
    """The table of the readers, what costs most, what flips, the verdicts, and where the report is."""
    from pipeline.benchmark.analysis.targets import Outcome
    from pipeline.benchmark.report.charts import severity_name

    found = written.statistics
    by_severity = len(found.by_severity) <= _MOST_ROWS
    screen().print(_table(found.by_severity if by_severity else found.by_mode, dirt=by_severity))
    print("ms: median time to compute a part; read ms: less the simulated scan")
    _print_factors(found)
    _print_stability(found)
    # of readers given several things the page has them all
    for v in written.verdicts if len(found.given) == 1 else ():
        word = v.outcome.value if v.outcome is Outcome.MET else v.outcome.value.upper()
        dirt = "" if v.severity is None else f"dirt {severity_name(v.severity)}, "
        print(f"{word}: {v.reader}, {dirt}{v.target}: {v.found}")
    for mode, words in written.drift.items():
        print(f"warning: {mode}: {words}", file=sys.stderr)
    for path in (written.page, written.table, written.figures):
        print(f"wrote {path}")


def _print_stability(found: Statistics) -> None:
    if not found.stability:
        return
    headings = ("reader", "how", "parts", "decisions", "at most", "texts", "at most",
                "accepted", "other text", "at most")  # fmt: skip
    table = plain_table(headings, ("reader", "how"))
    for s in found.stability:
        table.add_row(
            s.key.reader, s.perturbation or "any way", str(s.verdicts.total), str(s.verdicts.count),
            f"{s.verdicts.high:.1%}", str(s.texts.count), f"{s.texts.high:.1%}", str(s.accepted_texts.total),
            str(s.accepted_texts.count), f"{s.accepted_texts.high:.1%}",
        )  # fmt: skip
    screen().print(table)
    print(
        "how: perturbed; decisions, texts: parts that flip; other text: of the accepted; at most: exact, 95 %\n"
    )


def screen() -> Console:
    """A console that is no wider than 80 columns where nobody looks on."""
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=COLUMNS)


def plain_table(headings: Sequence[str], left: Sequence[str]) -> Table:
    """Columns without lines; those named in `left` are words, and are folded if they must be."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, header_style="bold")
    for heading in headings:
        words = heading in left
        table.add_column(
            heading, justify="left" if words else "right", no_wrap=not words and " " not in heading,
            overflow="fold" if words else "ellipsis",
        )  # fmt: skip
    return table


def _table(groups: Sequence[Group], *, dirt: bool) -> Table:
    from pipeline.benchmark.report.charts import severity_name

    headings = (
        "reader",
        "parts",
        "serials",
        "chars",
        "accepted",
        "accepted wrong",
        "errors",
        "ms",
        "read ms",
    )
    table = plain_table(("dirt", *headings) if dirt else headings, ("reader",))
    for g in groups:
        first = (severity_name(g.key.severity),) if dirt else ()
        table.add_row(
            *first, g.key.reader, str(g.serials.total), f"{g.serials.value:.2%}",
            f"{g.characters.value:.2%}", f"{g.accepted.value:.1%}", str(g.split.accepted_wrong),
            str(g.split.failed), f"{1000 * g.compute_s[0]:.0f}", f"{1000 * g.reading_s[0]:.0f}",
        )  # fmt: skip
    return table


def _print_factors(found: Statistics) -> None:
    from pipeline.benchmark.analysis.factors import factor_name
    from pipeline.benchmark.exam.condition import level_name
    from pipeline.benchmark.report.charts import leading, modes_in
    from pipeline.benchmark.report.page import points

    lead = leading(modes_in(found.by_mode))
    effects = [e for e in found.effects if e.mode == lead][:_MOST_FACTORS]
    if not effects:
        return
    print()
    table = plain_table(("factor", "costs most", "points", "95 %", "costs least", "points"),
                        ("factor", "costs most", "costs least"))  # fmt: skip
    for e in effects:
        worst, best = e.levels[0], e.levels[-1]
        table.add_row(
            factor_name(e.factor), level_name(worst.level), points(worst.difference.value),
            f"{points(worst.difference.low)} to {points(worst.difference.high)}", level_name(best.level),
            points(best.difference.value),
        )  # fmt: skip
    screen().print(table)
    print(f"points: characters right of {lead}, less the mean of the factor's other levels\n")
