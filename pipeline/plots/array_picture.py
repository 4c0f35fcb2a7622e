"""Arrays as a picture: stage seconds against the number of whiskers."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from pipeline.plots.pictures import STEEL, note, styled
from whisker_array.design.array_design import ArrayChoice, ArrayRequest


@styled
def array_figure(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> Figure:
    """Draw stage seconds of the arrays. Narrow, to be read on a phone."""
    figure = Figure(figsize=(5.2, 3.6), dpi=150)
    axes = figure.subplots()
    whiskers, seconds = [c.plan.array.n_whiskers for c in choices], [c.stage_s for c in choices]
    axes.loglog(whiskers, seconds, "o-", color=STEEL, markersize=5, linewidth=1.6)
    for place in zip(whiskers, seconds, strict=True):
        note(axes, f"{place[1]:.1f}", place, (0, 7), ha="center")
    axes.set_xticks(whiskers, [str(n) for n in whiskers])
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.grid()
    axes.set(
        ylim=(0.75 * min(seconds), 1.5 * max(seconds)),
        xlabel="whiskers",
        ylabel="stage seconds a serial",
        title=f"{100 * request.accuracy:g} % of characters at dirt {request.severity:g}, "
        f"{request.character_height_mm:g} mm high",
    )
    return figure
