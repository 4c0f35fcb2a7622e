"""Cost and results of plans of touch: a table, and a page with curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, PercentFormatter

from glyphs.atomic import replacing
from pipeline.benchmark.analysis.groups import grouped, split_of
from pipeline.benchmark.readers.plans import TouchPlan
from pipeline.benchmark.report.charts import inlined, severity_name, severity_panels
from pipeline.benchmark.report.page import write_page, write_table
from pipeline.benchmark.trials.journal import Trial
from pipeline.reading.scan_plan import USUAL_HEIGHT_MM

SECONDS_SHOWN = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
_STYLES = {
    "active": ("#0072b2", "o", "-"),
    "uniform": ("#d55e00", "s", "--"),
    "random": ("#7f7f7f", "^", ":"),
    "whole": ("#000000", "D", ""),
}


@dataclass(frozen=True)
class PlanResult:
    """Results of a plan on some parts.

    Attributes:
        plan: which.
        n: parts.
        stage_s: mean.
        median_s: median of the same.
        right: serials.
        accepted: serials.
        wrong: of those accepted.
    """

    plan: TouchPlan
    n: int
    stage_s: float
    median_s: float
    right: int
    accepted: int
    wrong: int


def results(trials: Iterable[Trial]) -> list[PlanResult]:
    """A row a plan, in the order of the trials."""
    found = []
    for key, own in grouped(trials).items():
        split, seconds = split_of(own), [t.scan_s for t in own]
        right = sum(t.right for t in own)
        found.append(
            PlanResult(
                _plan(key.mode),
                len(own),
                fmean(seconds),
                median(seconds),
                right,
                split.accepted,
                split.accepted_wrong,
            )
        )
    return found


def by_severity(trials: Sequence[Trial]) -> list[tuple[float | None, list[PlanResult]]]:
    """The results at every severity that is known, then over all (None)."""
    known = sorted({t.severity for t in trials if t.severity is not None})
    return [(s, results(t for t in trials if s is None or t.severity == s)) for s in (*known, None)]


def write_stage_time(trials: Sequence[Trial], folder: Path, *, command: str) -> tuple[Path, ...]:
    """Write the table, the page, and the curves of what was given first.

    Args:
        trials: by modes of `pipeline.benchmark.readers.plans`.
        folder: for active.csv, active.html and active.png.
        command: how to do it again, as typed.
    """
    table, page, picture = (folder / f"active.{suffix}" for suffix in ("csv", "html", "png"))
    rows = [_row(t, _plan(t.mode)) for t in trials]
    write_table(table, [list(rows[0]), *(list(row.values()) for row in rows)])
    given = {
        given: [t for t in trials if t.given == given] for given in dict.fromkeys(t.given for t in trials)
    }
    waits = sorted(
        w for t in trials if t.mode.startswith("active") and (w := t.measures.get("usual_thought_s"))
    )
    write_page(
        page,
        "stage_time.html.j2",
        title="What a serial costs in stage seconds",
        command=command,
        sections=[
            {
                "given": name,
                "curves": inlined(curves_figure(own)),
                "rows": [
                    ("all" if severity is None else severity_name(severity), row)
                    for severity, found in by_severity(own)
                    for row in found
                ],
            }
            for name, own in given.items()
        ],
        parts=len({t.part for t in trials}),
        wait_ms=1000.0 * waits[len(waits) // 2] if waits else 0.0,
        failed=sum(bool(t.error) for t in trials),
    )
    with replacing(picture) as written:
        curves_figure(next(iter(given.values()))).savefig(written, format="png", dpi=110)
    return table, page, picture


def _plan(mode: str) -> TouchPlan:
    plan = TouchPlan.of(mode)
    if plan is None:
        raise ValueError(f"{mode} is no plan of touch")
    return plan


def _row(t: Trial, plan: TouchPlan) -> dict[str, object]:
    return {
        "part": t.part, "plan": plan.name, "level": f"{plan.level:g}", "given": t.given, "severity": t.severity,
        "soil": t.levels.get("soil", ""), "height_mm": t.levels.get("height_mm", USUAL_HEIGHT_MM),
        "truth": t.truth, "text": t.text, "decision": t.decision, "right": t.right, "stage_s": t.scan_s,
        "passes": int(t.measures.get("passes", 0)), "stop": t.flags,
        **{name: t.measures.get(name, 0.0) for name in ("thought_s", "usual_thought_s")}, "error": t.error,
    }  # fmt: skip


def curves_figure(trials: Sequence[Trial]) -> Figure:
    """Accepted serials against mean stage seconds, a panel for every severity; a cross where any was wrong."""
    found = dict(by_severity(trials))
    known = [severity for severity in found if severity is not None]
    return severity_panels(known, lambda axes, severity: _panel(axes, found[severity]), height_in=2.8)


def _panel(axes: Axes, rows: Sequence[PlanResult]) -> None:
    for name, (colour, marker, line) in _STYLES.items():
        own = sorted((r for r in rows if r.plan.name == name), key=lambda r: r.stage_s)
        if not own:
            continue
        axes.plot(
            [r.stage_s for r in own], [r.accepted / r.n for r in own], color=colour, marker=marker,
            linestyle=line, zorder=3 if name == "active" else 2, label=name,
        )  # fmt: skip
        wrong = [r for r in own if r.wrong]
        axes.scatter(
            [r.stage_s for r in wrong], [r.accepted / r.n for r in wrong],
            marker="x", s=90.0, color="#c00000", zorder=5,
        )  # fmt: skip
    # the whole plan takes twenty times as long as the others
    axes.set_xscale("log")
    axes.set_xlim(
        min(4.0, 0.8 * min(r.stage_s for r in rows)), max(400.0, 1.2 * max(r.stage_s for r in rows))
    )
    axes.set_xticks(SECONDS_SHOWN, [f"{s:g}" for s in SECONDS_SHOWN], minor=False)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(-0.03, 1.05)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_xlabel("mean stage time of a part, s", fontsize=9)
    axes.set_ylabel("accepted", fontsize=9)
