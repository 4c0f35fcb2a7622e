"""Charts of a benchmark's report, for screen and paper."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pipeline.benchmark.analysis.confidence import Reliability
from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.readers.modes import EXPERTS, PEERS
from pipeline.common.shares import Share
from pipeline.plots.pictures import styled

_STYLES = (
    ("#0072b2", "o", "-"), ("#d55e00", "s", "--"), ("#009e73", "D", "-"), ("#7f7f7f", "^", ":"),
    ("#a0522d", "v", ":"), ("#cc79a7", "<", "-."), ("#56b4e9", ">", "-."),
)  # fmt: skip
_ORDER = ("tactile", "vision", "fused", *EXPERTS, *PEERS)
WIDTH_IN = 9.6


def style_of(mode: str) -> tuple[str, str, str]:
    """(colour, marker, line) of a mode, the same in every chart."""
    return _STYLES[_ORDER.index(mode) % len(_STYLES)] if mode in _ORDER else ("#000000", "x", "-")


def modes_in(groups: Sequence[Group]) -> list[str]:
    """The modes, in their usual order."""
    modes = dict.fromkeys(g.key.mode for g in groups)
    return sorted(modes, key=lambda m: _ORDER.index(m) if m in _ORDER else len(_ORDER))


def leading_mode(modes: Sequence[str]) -> str:
    """The mode that a page shows first: the built-in one with most senses, else the first."""
    return next((mode for mode in ("fused", "tactile", "vision") if mode in modes), modes[0])


def severities_in(groups: Sequence[Group]) -> list[float | None]:
    """The severities, the cleanest first, unknown ones last."""
    severities = {g.key.severity for g in groups}
    return sorted(severities, key=lambda s: (s is None, s or 0.0))


def _legend_below(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)


@styled
def accuracy_figure(groups: Sequence[Group]) -> Figure:
    """Shares of serials and characters right against severity, with Wilson's 95 % intervals."""
    figure = Figure(figsize=(WIDTH_IN, 3.8))
    panels = figure.subplots(1, 2, sharey=True)
    severities, modes = severities_in(groups), modes_in(groups)
    for axes, measure in zip(panels, ("serials", "characters"), strict=True):
        for rank, mode in enumerate(modes):
            of_mode = sorted(
                (g for g in groups if g.key.mode == mode), key=lambda g: severities.index(g.key.severity)
            )
            shares: list[Share] = [getattr(g, measure) for g in of_mode]
            colour, marker, line = style_of(mode)
            # side by side, so that no interval hides another
            beside = 0.18 * (rank - 0.5 * (len(modes) - 1)) / max(1, len(modes) - 1)
            axes.errorbar(
                [severities.index(g.key.severity) + beside for g in of_mode], [s.value for s in shares],
                yerr=([s.value - s.low for s in shares], [s.high - s.value for s in shares]), color=colour,
                marker=marker, linestyle=line, markersize=5, linewidth=1.4, elinewidth=1.0, capsize=2.5, label=mode,
            )  # fmt: skip
        axes.set_title(f"{measure} right")
        axes.set(ylim=(-0.02, 1.03), xlabel="severity of the dirt")
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xticks(range(len(severities)), [level_name(s) for s in severities])
        axes.grid()
    _legend_below(figure, panels[0])
    return figure


def data_uri(figure: Figure, *, kind: str = "svg") -> str:
    """The figure as a data URI, so that the page is self-contained: "svg" for lines, "jpg" for pictures of surfaces."""
    stream = io.BytesIO()
    if kind == "svg":
        with matplotlib.rc_context({"svg.hashsalt": "tactile-marks"}):
            figure.savefig(stream, format="svg", metadata={"Date": None})
        mime = "image/svg+xml"
    else:
        figure.savefig(stream, format="jpg", dpi=110, pil_kwargs={"quality": 82})
        mime = "image/jpeg"
    return f"data:{mime};base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"


@styled
def risk_figure(groups: Sequence[Group]) -> Figure:
    """Share of wrong serials among the most certain ones against coverage; one panel per severity."""
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
            xlabel="coverage: share accepted, the most certain first", ylabel="risk: of these wrong",
        )  # fmt: skip
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.grid()
    _legend_below(figure, panels[0])
    return figure


@styled
def reliability_figure(groups: Sequence[Group]) -> Figure:
    """Reported confidence against the share right, for serials and characters of every mode; larger marks stand for
    more readings, bars for Wilson's 95 % intervals."""
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
        axes.set_xlabel("reported confidence")
    for axes in panels[:, 0]:
        axes.set_ylabel("share right")
    return figure


def _diagram(axes: Axes, diagram: Reliability, colour: str) -> None:
    axes.plot([0, 1], [0, 1], color="#9aa5ad", linewidth=0.8, linestyle="--")
    ends, ticks = (-0.03, 1.03), (0.0, 0.5, 1.0)
    axes.set(xlim=ends, ylim=ends, xticks=ticks, yticks=ticks, aspect="equal")
    axes.grid()
    if not diagram.bins:
        axes.text(0.5, 0.5, "no confidence reported", ha="center", va="center")
        return
    x, y, n, low, high = np.transpose(
        [(b.confidence, b.right.value, b.right.total, b.right.low, b.right.high) for b in diagram.bins]
    )
    axes.vlines(x, low, high, color=colour)
    axes.plot(x, y, color=colour, linewidth=0.8, alpha=0.6)
    axes.scatter(x, y, s=12.0 + 90.0 * n / n.sum(), color=colour, zorder=3)
