"""Tables that the exam commands print, at most 80 columns wide."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from pipeline.cli.tables import print_table

if TYPE_CHECKING:
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
    _print_groups(found.by_severity if by_severity else found.by_mode, dirt=by_severity)
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
    for path in written.files:
        print(f"wrote {path}")


def _print_stability(found: Statistics) -> None:
    if not found.stability:
        return
    headings = ("reader", "how", "parts", "decisions", "at most", "texts", "at most",
                "accepted", "other text", "at most")  # fmt: skip
    rows = (
        (s.key.reader, s.perturbation or "any way", s.verdicts.total, s.verdicts.count, f"{s.verdicts.high:.1%}",
         s.texts.count, f"{s.texts.high:.1%}", s.accepted_texts.total, s.accepted_texts.count,
         f"{s.accepted_texts.high:.1%}")
        for s in found.stability
    )  # fmt: skip
    print_table(headings, rows, ("reader", "how"))
    print(
        "how: perturbed; decisions, texts: parts that flip; other text: of the accepted; at most: exact, 95 %\n"
    )


def _print_groups(groups: Sequence[Group], *, dirt: bool) -> None:
    from pipeline.benchmark.exam.condition import level_name

    headings = (
        "dirt",
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
    rows = (
        (level_name(g.key.severity), g.key.reader, g.serials.total, f"{g.serials.value:.2%}",
         f"{g.characters.value:.2%}", f"{g.accepted.value:.1%}", g.split["accepted_wrong"], g.split["failed"],
         *(f"{1000 * g.seconds[name][0]:.0f}" for name in ("compute_s", "reading_s")))
        for g in groups
    )  # fmt: skip
    first = 0 if dirt else 1
    print_table(headings[first:], (row[first:] for row in rows), ("reader",))


def _print_factors(found: Statistics) -> None:
    from pipeline.benchmark.analysis.factors import factor_name
    from pipeline.benchmark.exam.condition import level_name
    from pipeline.benchmark.report.charts import leading_mode, modes_in
    from pipeline.benchmark.report.page import points, points_span

    lead = leading_mode(modes_in(found.by_mode))
    effects = [e for e in found.effects if e.mode == lead and e.levels[0].difference.value][:_MOST_FACTORS]
    if not effects:
        return
    rows = (
        (factor_name(e.factor), level_name(worst.level), points(worst.difference.value), points_span(worst.difference),
         level_name(best.level), points(best.difference.value))
        for e in effects
        for worst, *_, best in [e.levels]
    )  # fmt: skip
    print()
    headings = ("factor", "costs most", "points", "95 %", "costs least", "points")
    print_table(headings, rows, ("factor", "costs most", "costs least"))
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
    from pipeline.benchmark.analysis.comparisons import compare
    from pipeline.benchmark.analysis.groups import GroupKey, group_of

    for reader, answers in read.items():
        for parts, what in (
            (answers.missing, "have no answer and count as read empty"),
            (answers.unknown, "are not in the exam and do not count"),
        ):
            if parts:
                named = ", ".join(parts[:_MOST_NAMED]) + (", ..." if len(parts) > _MOST_NAMED else "")
                print(f"{reader}: {len(parts)} parts {what}: {named}", file=sys.stderr)
    for reader, answers in read.items():
        g = group_of(GroupKey(reader), answers.trials)
        chars, serials = (f"{s.value:.2%} ({s.low:.2%} to {s.high:.2%})" for s in (g.characters, g.serials))
        print(
            f"{reader}: characters {chars}, serials {serials} of {g.serials.total}, "
            f"accepted {g.accepted.count}, of these wrong {g.wrong_of_accepted.count}"
        )
    (first, of_first), *others = ((reader, answers.trials) for reader, answers in read.items())
    for reader, trials in others:
        compared = compare(GroupKey(reader), trials, GroupKey(first), of_first)
        pairs, less = compared.serials, compared.characters.difference
        print(
            f"{reader} less {first}: characters {less.value:+.2%} ({less.low:+.2%} to {less.high:+.2%}), "
            f"serials only right by it {pairs.only_first}, only by the other {pairs.only_second} "
            f"(p {pairs.p_differ:.2g})"
        )


def print_comparison(written: Compared) -> None:
    """Print what differs between two benchmarks, over all and by factor, and what flipped."""
    from pipeline.benchmark.analysis.changes import Flip

    found = written.changes
    print(f"{found.parts} parts, B less A; characters in percentage points")
    print_table(("reader", *_OF_ROWS), map(_cells, found.overall), ("reader",))
    largest = sorted(found.by_factor, key=lambda row: -abs(row.compared.characters.difference.value))
    if shown := [row for row in largest if row.compared.characters.difference.value][:_MOST_CHANGES]:
        print("\nlargest by factor")
        rows = ([reader, row.name, *more] for row in shown for reader, *more in [_cells(row)])
        print_table(("reader", "of", *_OF_ROWS), rows, ("reader", "of"))
    if found.flips:
        print("\nreadings that flipped")
        names = {flip: flip.name.lower().replace("_", " ") for flip in Flip}
        rows = ([reader, *(counts[flip] for flip in Flip)] for reader, counts in found.counts.items())
        print_table(("reader", *names.values()), rows, ("reader",))
        for flip, name in names.items():
            print(f"{name}: {flip.value}")
    else:
        print("nothing flipped")
    if found.left_out:
        print(f"only in one of them, not compared: {'; '.join(found.left_out)}")
    if written.problem:
        print(f"no pictures: {written.problem}")
    for path in written.files:
        print(f"wrote {path}")


_OF_ROWS = ("parts", "chars", "95 %", "gained", "lost", "p")


def _cells(row: Row) -> Iterator[object]:
    from pipeline.benchmark.report.page import points, points_span

    c, less = row.compared, row.compared.characters.difference
    yield from (c.first.reader, c.parts, points(less.value), points_span(less))
    yield from (c.serials.only_first, c.serials.only_second, f"{c.serials.p_differ:.3f}")
