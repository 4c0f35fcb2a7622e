"""Charts of a benchmark's report, for screen and paper; series can be distinguished without colour."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.readers.experts import EXPERT_MODES
from pipeline.benchmark.readers.modes import PEERS
from pipeline.common.shares import Share
from pipeline.plots.pictures import styled

_STYLES = (
    ("#0072b2", "o", "-"), ("#d55e00", "s", "--"), ("#009e73", "D", "-"), ("#7f7f7f", "^", ":"),
    ("#a0522d", "v", ":"), ("#cc79a7", "<", "-."), ("#56b4e9", ">", "-."),
)  # fmt: skip
_ORDER = ("tactile", "vision", "fused", *EXPERT_MODES, *PEERS)
WIDTH_IN = 9.6


def style_of(mode: str) -> tuple[str, str, str]:
    """(colour, marker, line) of a mode, the same in every chart."""
    return _STYLES[_ORDER.index(mode) % len(_STYLES)] if mode in _ORDER else ("#000000", "x", "-")


def modes_in(groups: Sequence[Group]) -> list[str]:
    """The modes, in their usual order."""
    found = list(dict.fromkeys(g.key.mode for g in groups))
    return sorted(found, key=lambda m: _ORDER.index(m) if m in _ORDER else len(_ORDER))


def leading_mode(modes: Sequence[str]) -> str:
    """The mode that a page shows first: of the project's own the one with most senses, else the first."""
    return next((mode for mode in ("fused", "tactile", "vision") if mode in modes), modes[0])


def severities_in(groups: Sequence[Group]) -> list[float | None]:
    """The severities, the cleanest first, the unknown last."""
    found = {g.key.severity for g in groups}
    return sorted(found, key=lambda s: (s is None, s or 0.0))


def legend_below(figure: Figure, axes: Axes) -> None:
    """Say under the panels what the lines of the first mean."""
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
            own = sorted(
                (g for g in groups if g.key.mode == mode), key=lambda g: severities.index(g.key.severity)
            )
            shares: list[Share] = [getattr(g, measure) for g in own]
            colour, marker, line = style_of(mode)
            # side by side, so that no interval hides another
            beside = 0.18 * (rank - 0.5 * (len(modes) - 1)) / max(1, len(modes) - 1)
            axes.errorbar(
                [severities.index(g.key.severity) + beside for g in own], [s.value for s in shares],
                yerr=([s.value - s.low for s in shares], [s.high - s.value for s in shares]), color=colour,
                marker=marker, linestyle=line, markersize=5, linewidth=1.4, elinewidth=1.0, capsize=2.5, label=mode,
            )  # fmt: skip
        axes.set_title(f"{measure} right")
        axes.set(ylim=(-0.02, 1.03), xlabel="severity of the dirt")
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_xticks(range(len(severities)), [level_name(s) for s in severities])
        axes.grid()
    legend_below(figure, panels[0])
    return figure


def data_uri(figure: Figure, *, kind: str = "svg") -> str:
    """The figure as a data URI: nothing beside the page is needed to show it.

    Args:
        figure: to be drawn.
        kind: "svg" for lines, "jpg" for pictures of surfaces.
    """
    stream = io.BytesIO()
    if kind == "svg":
        with matplotlib.rc_context({"svg.hashsalt": "tactile-marks"}):
            figure.savefig(stream, format="svg", metadata={"Date": None})
        mime = "image/svg+xml"
    else:
        figure.savefig(stream, format="jpg", dpi=110, pil_kwargs={"quality": 82})
        mime = "image/jpeg"
    return f"data:{mime};base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
