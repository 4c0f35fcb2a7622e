"""Tables that the exam commands print, at most 80 columns wide."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pipeline.cli.tables import plain_table, screen

if TYPE_CHECKING:
    from rich.table import Table

    from pipeline.benchmark.analysis.changes import Row
    from pipeline.benchmark.analysis.groups import Group
    from pipeline.benchmark.analysis.statistics import Statistics
    from pipeline.benchmark.report.change_report import Compared
    from pipeline.benchmark.report.writing import Written
    from pipeline.benchmark.trials.answers import Answers

_MOST_ROWS = 24
_MOST_FACTORS = 6
_MOST_CHANGES = 8
_MOST_NAMED = 5


def print_result(written: Written) -> None:
    """Print the table of readers, what costs most, what flips, the verdicts, and where the report is."""
    from pipeline.benchmark.analysis.checks import Outcome
    from pipeline.benchmark.exam.condition import level_name

    found = written.statistics
    by_severity = len(found.by_severity) <= _MOST_ROWS
    screen().print(_table(found.by_severity if by_severity else found.by_mode, dirt=by_severity))
    print("ms: median time to compute a part; read ms: less the simulated scan")
    _print_plans(found)
    _print_factors(found)
    _print_stability(found)
    # of readers given several things the page has them all
    for v in written.verdicts if len(found.given) == 1 else ():
        word = v.outcome.value if v.outcome is Outcome.MET else v.outcome.value.upper()
        dirt = "" if v.severity is None else f"dirt {level_name(v.severity)}, "
        print(f"{word}: {v.reader}, {dirt}{v.target}: {v.found}")
    for mode, words in written.drift.items():
        print(f"warning: {mode}: {words}", file=sys.stderr)
    print_files(written)


def print_files(written: Written) -> None:
    """Name the files of a report."""
    for path in (written.page, written.document, written.table, written.figures):
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


def _table(groups: Sequence[Group], *, dirt: bool) -> Table:
    from pipeline.benchmark.exam.condition import level_name

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
        first = (level_name(g.key.severity),) if dirt else ()
        table.add_row(
            *first, g.key.reader, str(g.serials.total), f"{g.serials.value:.2%}",
            f"{g.characters.value:.2%}", f"{g.accepted.value:.1%}", str(g.split["accepted_wrong"]),
            str(g.split["failed"]), *(f"{1000 * g.seconds[name][0]:.0f}" for name in ("compute_s", "reading_s")),
        )  # fmt: skip
    return table


def _print_factors(found: Statistics) -> None:
    from pipeline.benchmark.analysis.factors import factor_name
    from pipeline.benchmark.exam.condition import level_name
    from pipeline.benchmark.report.charts import leading_mode, modes_in
    from pipeline.benchmark.report.page import points

    lead = leading_mode(modes_in(found.by_mode))
    effects = [e for e in found.effects if e.mode == lead and e.levels[0].difference.value][:_MOST_FACTORS]
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


def _print_plans(found: Statistics) -> None:
    """Print what each plan of touch costs and brings."""
    from pipeline.benchmark.readers.plans import TouchPlan

    plans = [(g, plan) for g in found.by_severity if (plan := TouchPlan.of(g.key.mode)) is not None]
    for g, plan in plans:
        print(
            f"dirt {g.key.severity}  {plan.name:8} {plan.level_text:32} {g.stage_s:6.1f} s, "
            f"accepted {g.accepted.count} of {g.accepted.total}, {g.wrong_of_accepted.count} of them wrong"
        )


def print_scores(read: Mapping[str, Answers]) -> None:
    """Print a line a reader, and each but the first beside the first; of the same parts, of which there are any."""
    from pipeline.benchmark.analysis.confusion import characters_right
    from pipeline.benchmark.analysis.pairs import compare_characters, mcnemar
    from pipeline.common.shares import share

    for reader, answers in read.items():
        for parts, what in (
            (answers.missing, "have no answer and count as read empty"),
            (answers.unknown, "are not in the exam and do not count"),
        ):
            if parts:
                named = ", ".join(parts[:_MOST_NAMED]) + (", ..." if len(parts) > _MOST_NAMED else "")
                print(f"{reader}: {len(parts)} parts {what}: {named}", file=sys.stderr)
    right = {reader: [characters_right(trial) for trial in a.trials] for reader, a in read.items()}
    (first, of_first), *others = ((reader, a.trials) for reader, a in read.items())
    total = [len(trial.truth) for trial in of_first]
    for reader, answers in read.items():
        trials, chars = answers.trials, share(sum(right[reader]), sum(total))
        serials, accepted = (
            share(sum(t.right for t in trials), len(trials)),
            [t for t in trials if t.accepted],
        )
        print(
            f"{reader}: characters {chars.value:.2%} ({chars.low:.2%} to {chars.high:.2%}), "
            f"serials {serials.value:.2%} ({serials.low:.2%} to {serials.high:.2%}) of {len(trials)}, "
            f"accepted {len(accepted)}, of these wrong {sum(not t.right for t in accepted)}"
        )
    for reader, trials in others:
        pairs = mcnemar([t.right for t in trials], [t.right for t in of_first])
        difference = compare_characters(right[reader], right[first], total).difference
        print(
            f"{reader} less {first}: characters {difference.value:+.2%} "
            f"({difference.low:+.2%} to {difference.high:+.2%}), serials only right by it {pairs.only_first}, "
            f"only by the other {pairs.only_second} (p {pairs.p_differ:.2g})"
        )


def print_comparison(written: Compared) -> None:
    """Print what differs between two benchmarks, over all and by factor, and what flipped."""
    from pipeline.benchmark.analysis.changes import Flip

    found = written.changes
    print(f"{found.parts} parts, B less A; characters in percentage points")
    _print_rows(found.overall, of=False)
    largest = sorted(found.by_factor, key=lambda row: -abs(row.compared.characters.difference.value))
    if shown := [row for row in largest if row.compared.characters.difference.value][:_MOST_CHANGES]:
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
    from pipeline.benchmark.report.page import points

    words = ("reader", "of") if of else ("reader",)
    table = plain_table((*words, "parts", "chars", "95 %", "gained", "lost", "p"), words)
    for row in rows:
        c, less = row.compared, row.compared.characters.difference
        table.add_row(
            c.first.reader, *([row.name] if of else []), str(c.parts), points(less.value),
            f"{points(less.low)} to {points(less.high)}", str(c.serials.only_first),
            str(c.serials.only_second), f"{c.serials.p_differ:.3f}",
        )  # fmt: skip
    screen().print(table)
