"""Charts of a benchmark's report, for screen and paper; series can be distinguished without colour."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Callable, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, PercentFormatter
from numpy.typing import NDArray

from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.readers.experts import EXPERT_MODES
from pipeline.benchmark.readers.modes import PEERS
from pipeline.benchmark.readers.plans import TouchPlan
from pipeline.common.shares import Share

_STYLES = (
    ("#0072b2", "o", "-"), ("#d55e00", "s", "--"), ("#009e73", "D", "-"), ("#7f7f7f", "^", ":"),
    ("#a0522d", "v", ":"), ("#cc79a7", "<", "-."), ("#56b4e9", ">", "-."),
)  # fmt: skip
_ORDER = ("tactile", "vision", "fused", *EXPERT_MODES, *PEERS)
WIDTH_IN = 9.6


def style_of(mode: str) -> tuple[str, str, str]:
    """(colour, marker, line) of a mode, the same in every chart."""
    return _STYLES[_ORDER.index(mode) % len(_STYLES)] if mode in _ORDER else ("#000000", "x", "-")


def severity_name(severity: float | None) -> str:
    """Write a severity."""
    return "as given" if severity is None else f"{severity:g}"


def modes_in(groups: Sequence[Group]) -> list[str]:
    """The modes, in their usual order."""
    found = list(dict.fromkeys(g.key.mode for g in groups))
    return sorted(found, key=lambda m: _ORDER.index(m) if m in _ORDER else len(_ORDER))


def leading(modes: Sequence[str]) -> str:
    """The mode that a page speaks of first: of the project's own the one with most senses, else the first."""
    return next((mode for mode in ("fused", "tactile", "vision") if mode in modes), modes[0])


def severities_in(groups: Sequence[Group]) -> list[float | None]:
    """The severities, the cleanest first, the unknown last."""
    found = {g.key.severity for g in groups}
    return sorted(found, key=lambda s: (s is None, s or 0.0))


def severity_panels(
    severities: Sequence[float | None], draw: Callable[[Axes, float | None], None], *, height_in: float
) -> Figure:
    """A panel for every severity, two in a row, under them what their lines mean.

    Args:
        severities: one a panel.
        draw: draws on the axes of a severity, with labels on the first ones.
        height_in: of a panel.
    """
    columns = min(2, max(1, len(severities)))
    rows = -(-len(severities) // columns) or 1
    figure = Figure(figsize=(WIDTH_IN, 0.7 + height_in * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, severity in zip(panels, severities, strict=False):
        draw(axes, severity)
        axes.set_title(f"dirt {severity_name(severity)}", loc="left", fontsize=10, fontweight="bold")
        ruled(axes)
    for axes in panels[len(severities) :]:
        axes.set_axis_off()
    _legend_below(figure, panels[0])
    return figure


def ruled(axes: Axes) -> None:
    """Draw a light grid behind the lines."""
    axes.grid(visible=True, color="#e3e6e8", linewidth=0.7)
    axes.set_axisbelow(True)


def _legend_below(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)


def _places(severities: Sequence[float | None]) -> dict[float | None, float]:
    """Place each severity on the axis: in proportion if all are known."""
    known = [s for s in severities if s is not None]
    if len(known) == len(severities) and len(known) > 1:
        return {s: s for s in known}
    return {s: float(k) for k, s in enumerate(severities)}


def accuracy_figure(groups: Sequence[Group]) -> Figure:
    """Shares of serials and characters right against severity; below, the shares wrong on a logarithmic scale.

    Bars are Wilson's 95 % intervals. A share of nought has no place on a logarithmic scale: a hollow mark at the
    foot, and the bar to the upper end of its interval.
    """
    figure = Figure(figsize=(WIDTH_IN, 6.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, height_ratios=[1.0, 1.0])
    measures: tuple[tuple[str, Callable[[Group], Share]], ...] = (
        ("serials", lambda g: g.serials),
        ("characters", lambda g: g.characters),
    )
    severities, modes = severities_in(groups), modes_in(groups)
    places = _places(severities)
    gap = min(np.diff(sorted(places.values())), default=1.0)
    for column, (name, measure) in enumerate(measures):
        upper, lower = axes[0, column], axes[1, column]
        totals = [measure(g).total for g in groups]
        floor = 0.3 / max(1, *totals)
        for rank, mode in enumerate(modes):
            shift = 0.09 * gap * (rank - 0.5 * (len(modes) - 1)) / max(1, len(modes) - 1) * 2
            own = sorted((g for g in groups if g.key.mode == mode), key=lambda g: places[g.key.severity])
            x = np.array([places[g.key.severity] + shift for g in own])
            _shares(upper, x, [measure(g) for g in own], mode)
            _wrong(lower, x, [measure(g) for g in own], mode, floor=floor)
        upper.set_title(f"{name} right", loc="left", fontsize=11, fontweight="bold")
        upper.set_ylim(-0.02, 1.03)
        upper.yaxis.set_major_formatter(PercentFormatter(1.0))
        lower.set_title(f"{name} wrong, logarithmic", loc="left", fontsize=11, fontweight="bold")
        lower.set_yscale("log")
        lower.set_ylim(0.8 * floor, 1.3)
        lower.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{100 * v:g} %"))
        lower.set_xticks([places[s] for s in severities], [severity_name(s) for s in severities])
        lower.set_xlabel("severity of the dirt")
        for each in (upper, lower):
            ruled(each)
    _legend_below(figure, axes[0, 0])
    return figure


def _shares(axes: Axes, x: NDArray[np.float64], shares: Sequence[Share], mode: str) -> None:
    colour, marker, line = style_of(mode)
    y = np.array([s.value for s in shares])
    low, high = np.array([s.low for s in shares]), np.array([s.high for s in shares])
    axes.errorbar(
        x, y, yerr=(np.maximum(0.0, y - low), np.maximum(0.0, high - y)), color=colour, marker=marker,
        linestyle=line, markersize=5, linewidth=1.4, elinewidth=1.0, capsize=2.5, label=mode,
    )  # fmt: skip


def _wrong(axes: Axes, x: NDArray[np.float64], shares: Sequence[Share], mode: str, *, floor: float) -> None:
    colour, marker, line = style_of(mode)
    y = np.array([max(floor, 1.0 - s.value) for s in shares])
    low = np.array([max(floor, 1.0 - s.high) for s in shares])
    high = np.array([max(floor, 1.0 - s.low) for s in shares])
    axes.plot(x, y, color=colour, linestyle=line, linewidth=1.2, alpha=0.8)
    axes.vlines(x, low, high, color=colour, linewidth=1.0)
    none = np.array([s.count == s.total for s in shares])
    axes.plot(x[~none], y[~none], color=colour, marker=marker, linestyle="none", markersize=5)
    axes.plot(
        x[none], y[none], color=colour, marker=marker, linestyle="none", markersize=6, markerfacecolor="white"
    )


def stage_figure(groups: Sequence[Group]) -> Figure:
    """Accepted serials of plans of touch against mean stage seconds; a red cross where an accepted one was wrong."""
    plans = {g.key: plan for g in groups if (plan := TouchPlan.of(g.key.mode)) is not None}

    def draw(axes: Axes, severity: float | None) -> None:
        here = [g for g in groups if g.key in plans and g.key.severity == severity]
        for name, (colour, marker, line) in zip(
            dict.fromkeys(p.name for p in plans.values()), _STYLES, strict=False
        ):
            own = sorted((g for g in here if plans[g.key].name == name), key=lambda g: g.stage_s)
            x, y = [g.stage_s for g in own], [g.accepted.value for g in own]
            axes.plot(x, y, color=colour, marker=marker, linestyle=line, label=name)
        wrong = [g for g in here if g.split["accepted_wrong"]]
        x, y = [g.stage_s for g in wrong], [g.accepted.value for g in wrong]
        axes.scatter(x, y, marker="x", s=90.0, color="#c00000", zorder=5)
        axes.set_xscale("log")  # the whole plan takes twenty times as long as the others
        axes.set_ylim(-0.03, 1.05)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xlabel("mean stage time of a part, s", fontsize=9)
        axes.set_ylabel("accepted", fontsize=9)

    return severity_panels(severities_in(groups), draw, height_in=2.8)


def inlined(figure: Figure, *, kind: str = "svg") -> str:
    """The figure as a data URI: nothing beside the page is needed to show it.

    Args:
        figure: to be drawn.
        kind: "svg" for lines, "jpg" for pictures of surfaces.
    """
    stream = io.BytesIO()
    if kind == "svg":
        with matplotlib.rc_context({"svg.hashsalt": "tactile-marks"}), warnings.catch_warnings():
            # a reader may answer in any script; what the font lacks is drawn as a box
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            figure.savefig(stream, format="svg", metadata={"Date": None})
        mime = "image/svg+xml"
    else:
        figure.savefig(stream, format="jpg", dpi=110, pil_kwargs={"quality": 82})
        mime = "image/jpeg"
    return f"data:{mime};base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
