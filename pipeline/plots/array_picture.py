"""Arrays as a picture: stage seconds against the number of whiskers, and the combs from above, to scale."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Box

from whisker_array.design.array_design import ArrayChoice, ArrayRequest
from whisker_array.whisker.comb import Body

_STEEL, _MARK, _PALE = "#3b5b7a", "#c2571a", "#a5b5c7"
_DRAWN = (8, 24, 48)


def array_figure(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> Figure:
    """Stage seconds on top; below, what up to three of the arrays look like. Narrow, to be read on a phone."""
    drawn = [c for c in choices if c.plan.array.n_whiskers in _DRAWN] or [choices[-1]]
    figure = Figure(figsize=(5.2, 3.6 + 1.6 * len(drawn)), dpi=150, layout="constrained")
    grid = figure.add_gridspec(1 + len(drawn), 1, height_ratios=(3.4, *(1.6 for _ in drawn)))
    _seconds(figure.add_subplot(grid[0]), request, choices)
    for k, choice in enumerate(drawn, start=1):
        _comb(figure.add_subplot(grid[k]), choice)
    return figure


def _seconds(axes: Axes, request: ArrayRequest, choices: Sequence[ArrayChoice]) -> None:
    whiskers, seconds = [c.plan.array.n_whiskers for c in choices], [c.stage_s for c in choices]
    axes.plot(whiskers, seconds, "o-", color=_STEEL, ms=5, lw=1.6)
    for choice in choices:
        axes.annotate(
            f"{choice.stage_s:.1f}", (choice.plan.array.n_whiskers, choice.stage_s), xytext=(0, 7),
            textcoords="offset points", ha="center", fontsize=9,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(whiskers, [str(n) for n in whiskers])
    ticks = [t for t in (0.5, 1, 2, 5, 10, 20, 50, 100, 200) if min(seconds) / 2 < t < 2 * max(seconds)]
    axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
    axes.minorticks_off()
    axes.set_ylim(0.75 * min(seconds), 1.5 * max(seconds))
    axes.tick_params(labelsize=9)
    axes.set_xlabel("whiskers", fontsize=10)
    axes.set_ylabel("stage seconds a serial", fontsize=10)
    axes.grid(alpha=0.3)
    axes.set_title(
        f"{100 * request.accuracy:g} % of characters at dirt {request.severity:g}, "
        f"{request.character_height_mm:g} mm high",
        fontsize=10,
        loc="left",
    )


def _comb(axes: Axes, choice: ArrayChoice) -> None:
    """Bodies from above, mm, traced to the right; the foremost row on the right, dots are tips."""
    array = choice.plan.array
    body = array.body
    if not isinstance(body, Body):  # points have nothing to draw
        return
    reach = body.reach_mm
    for i, behind in enumerate(array.offset_mm):
        y = i * array.pitch_mm
        axes.add_patch(
            Box(
                (-behind - reach, y - 0.5 * body.width_mm),
                reach,
                body.width_mm,
                fc=_PALE,
                ec=_STEEL,
                lw=0.5,
                alpha=0.6,
            )
        )
        axes.plot(-behind - reach, y, ".", color=_MARK, ms=3)
    across = (array.n_whiskers - 1) * array.pitch_mm
    axes.set_xlim(-max(array.offset_mm) - 1.06 * reach, 0.1 * reach)
    axes.set_ylim(-body.width_mm, across + body.width_mm)
    axes.set_aspect("equal", adjustable="box")
    axes.tick_params(labelsize=8)
    rows = "1 row" if array.rows == 1 else f"{array.rows} rows, {array.stagger_mm:g} mm apart"
    axes.set_title(f"{array.n_whiskers} whiskers from above: {rows}", fontsize=9, loc="left")
