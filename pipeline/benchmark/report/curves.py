"""The charts of a benchmark's report about confidence: risk against coverage, and reliability."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pipeline.benchmark.analysis.calibration import Reliability
from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.report.charts import (
    WIDTH_IN,
    draw_grid,
    modes_in,
    severities_in,
    severity_panels,
    style_of,
)


def risk_figure(groups: Sequence[Group]) -> Figure:
    """Share of wrong serials among the surest, against how many are let through; a panel for every severity."""
    modes = modes_in(groups)

    def draw(axes: Axes, severity: float | None) -> None:
        most = 0.02
        for group in sorted(groups, key=lambda g: modes.index(g.key.mode)):
            if group.key.severity != severity:
                continue
            colour, _, line = style_of(group.key.mode)
            axes.plot(
                group.risk.coverage, group.risk.risk, color=colour, linestyle=line, linewidth=1.6,
                label=group.key.mode, clip_on=False,
            )  # fmt: skip
            most = max(most, float(group.risk.risk.max(initial=0.0)))
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, min(1.02, 1.08 * most)))
        axes.set(xlabel="coverage: share let through, the surest first", ylabel="risk: of these wrong")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))

    return severity_panels(severities_in(groups), draw, height_in=2.6)


def reliability_figure(groups: Sequence[Group]) -> Figure:
    """Confidence said against the share right, of serials and of characters of every mode.

    A bin's mark is larger the more it holds; bars are Wilson's 95 % intervals.
    """
    modes = modes_in(groups)
    in_a_row = len(modes) <= 2
    shape = (1, 2 * len(modes)) if in_a_row else (2, len(modes))
    figure = Figure(figsize=(max(WIDTH_IN, 2.4 * shape[1]), 3.1 * shape[0]), layout="constrained")
    panels = figure.subplots(*shape, squeeze=False, sharex=True, sharey=True)
    for column, mode in enumerate(modes):
        group = next(g for g in groups if g.key.mode == mode)
        diagrams = {"serials": group.serial_reliability, "characters": group.character_reliability}
        for row, (name, diagram) in enumerate(diagrams.items()):
            axes = panels[0, 2 * column + row] if in_a_row else panels[row, column]
            _diagram(axes, diagram, style_of(mode)[0])
            axes.set_title(f"{mode}, {name}\nECE {diagram.error:.3f}", loc="left", fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("confidence said", fontsize=9)
    for axes in panels[:, 0]:
        axes.set_ylabel("share right", fontsize=9)
    return figure


def _diagram(axes: Axes, diagram: Reliability, colour: str) -> None:
    axes.plot([0, 1], [0, 1], color="#9aa5ad", linewidth=0.8, linestyle="--")
    ends, ticks = (-0.03, 1.03), (0.0, 0.5, 1.0)
    axes.set(xlim=ends, ylim=ends, xticks=ticks, yticks=ticks, aspect="equal")
    draw_grid(axes)
    if not diagram.bins:
        axes.text(0.5, 0.5, "no confidence said", ha="center", va="center", fontsize=8)
        return
    x, y, n, low, high = np.transpose(
        [(b.confidence, b.right.value, b.right.total, b.right.low, b.right.high) for b in diagram.bins]
    )
    axes.vlines(x, low, high, color=colour)
    axes.plot(x, y, color=colour, linewidth=0.8, alpha=0.6)
    axes.scatter(x, y, s=12.0 + 90.0 * n / n.sum(), color=colour, zorder=3)
