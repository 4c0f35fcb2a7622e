"""What plans of touch cost and bring, as a table and a page with curves."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, PercentFormatter

from glyphs.atomic import replacing
from pipeline.benchmark.report.charts import WIDTH_IN, inlined, severity_name
from pipeline.benchmark.report.page import rendered
from pipeline.benchmark.stage_time.trial import PlanResult, TouchTrial, results

SECONDS_SHOWN = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
_STYLES = {
    "active": ("#0072b2", "o", "-"),
    "uniform": ("#d55e00", "s", "--"),
    "random": ("#7f7f7f", "^", ":"),
    "whole": ("#000000", "D", ""),
}
_LEVELS = {
    "active": "a serial is worth {0:g} s",
    "uniform": "{0:g} lines to half a height",
    "random": "{0:g} s at most",
    "whole": "{0:g} lines to a height, four directions",
}


def write_table(path: Path, tried: Sequence[TouchTrial]) -> None:
    """A row a trial, .csv."""
    with replacing(path) as written, written.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(TouchTrial)])
        writer.writeheader()
        writer.writerows(asdict(t) for t in tried)


def write_curves(path: Path, tried: Sequence[TouchTrial]) -> None:
    """The curves of what was given first, .png."""
    severities = sorted({t.severity for t in tried if t.severity is not None})
    figure = curves_figure(tried, severities, given=tried[0].given)
    with replacing(path) as written:
        figure.savefig(written, format="png", dpi=110)


def write_page(path: Path, tried: Sequence[TouchTrial], *, title: str, command: str) -> None:
    """The page, nothing beside it needed."""
    severities = sorted({t.severity for t in tried if t.severity is not None})
    givens = list(dict.fromkeys(t.given for t in tried))
    waits = sorted(t.usual_thought_s for t in tried if t.plan == "active" and t.usual_thought_s > 0.0)
    sections = [
        {
            "given": given,
            "curves": inlined(curves_figure(tried, severities, given=given)),
            "rows": [
                ("all" if severity is None else severity_name(severity), level_text(row), row)
                for severity in (*severities, None)
                for row in results(tried, severity=severity, given=given)
            ],
        }
        for given in givens
    ]
    page = rendered(
        "stage_time.html.j2",
        title=title,
        command=command,
        sections=sections,
        parts=len({t.part for t in tried}),
        wait_ms=1000.0 * waits[len(waits) // 2] if waits else 0.0,
        failed=sum(bool(t.error) for t in tried),
    )
    with replacing(path) as written:
        written.write_text(page, encoding="utf-8")


def level_text(row: PlanResult) -> str:
    """What makes a plan longer or shorter, in words."""
    return _LEVELS[row.plan.name].format(row.plan.level)


def curves_figure(tried: Sequence[TouchTrial], severities: Sequence[float], *, given: str) -> Figure:
    """Accepted serials against mean stage seconds, a panel for every severity; a cross where any was wrong."""
    columns = min(2, max(1, len(severities)))
    rows = -(-len(severities) // columns)
    figure = Figure(figsize=(WIDTH_IN, 0.7 + 2.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes, severity in zip(panels.flat, severities, strict=False):
        _panel(axes, results(tried, severity=severity, given=given))
        axes.set_title(f"dirt {severity_name(severity)}", loc="left", fontsize=10, fontweight="bold")
    for axes in panels.flat[len(severities) :]:
        axes.set_axis_off()
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, rows: Sequence[PlanResult]) -> None:
    for name, (colour, marker, line) in _STYLES.items():
        own = sorted((r for r in rows if r.plan.name == name), key=lambda r: r.stage_s)
        if not own:
            continue
        seconds = [r.stage_s for r in own]
        axes.plot(
            seconds,
            [r.accepted / r.n for r in own],
            color=colour,
            marker=marker,
            linestyle=line,
            zorder=3 if name == "active" else 2,
            label=name,
        )
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
    axes.grid(visible=True, color="#e3e6e8", linewidth=0.7)
