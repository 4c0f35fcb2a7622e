"""Arrays as a picture: stage seconds against the number of whiskers, and the combs from above, to scale."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Box
from matplotlib.ticker import FuncFormatter, LogLocator

from pipeline.plots.pictures import PALE, STEEL, VERMILION, note, styled
from whisker_array.design.array_design import ArrayChoice, ArrayRequest
from whisker_array.whisker.comb import Body

_DRAWN = (8, 24, 48)


@styled
def array_figure(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> Figure:
    """Draw stage seconds on top; below up to three of the arrays. Narrow, to be read on a phone."""
    drawn = [c for c in choices if c.plan.array.n_whiskers in _DRAWN] or [choices[-1]]
    figure = Figure(figsize=(5.2, 3.6 + 1.6 * len(drawn)), dpi=150)
    top, *combs = figure.subplots(1 + len(drawn), 1, height_ratios=(3.4, *(1.6 for _ in drawn)))
    whiskers, seconds = [c.plan.array.n_whiskers for c in choices], [c.stage_s for c in choices]
    top.loglog(whiskers, seconds, "o-", color=STEEL, markersize=5, linewidth=1.6)
    for place in zip(whiskers, seconds, strict=True):
        note(top, f"{place[1]:.1f}", place, (0, 7), ha="center")
    top.set_xticks(whiskers, [str(n) for n in whiskers])
    top.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    top.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    top.minorticks_off()
    top.grid()
    top.set(
        ylim=(0.75 * min(seconds), 1.5 * max(seconds)),
        xlabel="whiskers",
        ylabel="stage seconds a serial",
        title=f"{100 * request.accuracy:g} % of characters at dirt {request.severity:g}, "
        f"{request.character_height_mm:g} mm high",
    )
    for axes, choice in zip(combs, drawn, strict=True):
        _comb(axes, choice)
    return figure


def _comb(axes: Axes, choice: ArrayChoice) -> None:
    """Draw bodies from above, mm, traced to the right; the foremost row on the right, dots are tips."""
    array, body = choice.plan.array, choice.plan.array.body
    if not isinstance(body, Body):  # points have nothing to draw
        return
    reach = body.reach_mm
    for i, behind in enumerate(array.offset_mm):
        x, y = -behind - reach, i * array.pitch_mm
        axes.add_patch(
            Box((x, y - 0.5 * body.width_mm), reach, body.width_mm, fc=PALE, ec=STEEL, lw=0.5, alpha=0.6)
        )
        axes.plot(x, y, ".", color=VERMILION, markersize=3)
    rows = "1 row" if array.rows == 1 else f"{array.rows} rows, {array.stagger_mm:g} mm apart"
    across = (array.n_whiskers - 1) * array.pitch_mm
    axes.set(
        xlim=(-max(array.offset_mm) - 1.06 * reach, 0.1 * reach),
        ylim=(-body.width_mm, across + body.width_mm),
        title=f"{array.n_whiskers} whiskers from above: {rows}",
    )
    axes.set_aspect("equal", adjustable="box")
