"""The charts of a benchmark's report about confidence: risk against coverage, and reliability."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pipeline.benchmark.analysis.calibration import Reliability
from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.report.charts import (
    WIDTH_IN,
    legend_below,
    modes_in,
    severities_in,
    style_of,
)
from pipeline.plots.pictures import styled


@styled
def risk_figure(groups: Sequence[Group]) -> Figure:
    """Share of wrong serials among the surest, against how many are let through; a panel for every severity."""
    severities = severities_in(groups)
    rows = math.ceil(len(severities) / 2)
    figure = Figure(figsize=(WIDTH_IN, 0.7 + 2.6 * rows))
    panels = figure.subplots(rows, min(2, len(severities)), squeeze=False).ravel()
    for axes in panels[len(severities) :]:
        axes.set_axis_off()
    for axes, severity in zip(panels, severities, strict=False):
        most = 0.02
        for mode in modes_in(groups):
            for group in (g for g in groups if g.key.mode == mode and g.key.severity == severity):
                colour, _, line = style_of(mode)
                axes.plot(
                    group.risk.coverage, group.risk.risk, color=colour, linestyle=line, linewidth=1.6, label=mode,
                    clip_on=False,
                )  # fmt: skip
                most = max(most, float(group.risk.risk.max(initial=0.0)))
        axes.set(
            xlim=(0.0, 1.0), ylim=(0.0, min(1.02, 1.08 * most)), title=f"dirt {level_name(severity)}",
            xlabel="coverage: share let through, the surest first", ylabel="risk: of these wrong",
        )  # fmt: skip
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.grid()
    legend_below(figure, panels[0])
    return figure


@styled
def reliability_figure(groups: Sequence[Group]) -> Figure:
    """Confidence said against the share right, of serials and of characters of every mode.

    A bin's mark is larger the more it holds; bars are Wilson's 95 % intervals.
    """
    modes = modes_in(groups)
    figure = Figure(figsize=(max(WIDTH_IN, 2.4 * len(modes)), 6.2))
    panels = figure.subplots(2, len(modes), squeeze=False, sharex=True, sharey=True)
    for column, mode in zip(panels.T, modes, strict=True):
        group = next(g for g in groups if g.key.mode == mode)
        diagrams = {"serials": group.serial_reliability, "characters": group.character_reliability}
        for axes, (name, diagram) in zip(column, diagrams.items(), strict=True):
            _diagram(axes, diagram, style_of(mode)[0])
            axes.set_title(f"{mode}, {name}\nECE {diagram.error:.3f}")
    for axes in panels[-1]:
        axes.set_xlabel("confidence said")
    for axes in panels[:, 0]:
        axes.set_ylabel("share right")
    return figure


def _diagram(axes: Axes, diagram: Reliability, colour: str) -> None:
    axes.plot([0, 1], [0, 1], color="#9aa5ad", linewidth=0.8, linestyle="--")
    ends, ticks = (-0.03, 1.03), (0.0, 0.5, 1.0)
    axes.set(xlim=ends, ylim=ends, xticks=ticks, yticks=ticks, aspect="equal")
    axes.grid()
    if not diagram.bins:
        axes.text(0.5, 0.5, "no confidence said", ha="center", va="center")
        return
    x, y, n, low, high = np.transpose(
        [(b.confidence, b.right.value, b.right.total, b.right.low, b.right.high) for b in diagram.bins]
    )
    axes.vlines(x, low, high, color=colour)
    axes.plot(x, y, color=colour, linewidth=0.8, alpha=0.6)
    axes.scatter(x, y, s=12.0 + 90.0 * n / n.sum(), color=colour, zorder=3)
