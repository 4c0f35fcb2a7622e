"""What speed costs: the dynamic whisker over a stamped groove, its traces, and its errors against speed."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from whisker_array.simulation.dynamic_speed import FINE_ERROR, SpeedCost, groove_traces, speed_cost
from whisker_array.whisker.array import SAFE_SPEED_MM_S
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

HEIGHT_MM = 5.0
BEVELS_DEG = (30.0, 45.0, 60.0)
SPEEDS_MM_S = (5.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 140.0, 200.0, 300.0, 500.0)
TRACED_MM_S = (10.0, 50.0, 100.0, 200.0)
_LEAST_MM = 1e-3
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def speed_figure(settings: FigureSettings) -> Drawing:
    """The default whisker for characters of 5 mm; friction is that it is set up for."""
    whisker, touch = default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM)
    costs = {
        bevel: [
            speed_cost(
                whisker, touch, speed_mm_s=v, character_height_mm=HEIGHT_MM, bevel_rad=math.radians(bevel)
            )
            for v in SPEEDS_MM_S
        ]
        for bevel in BEVELS_DEG
    }
    figure = Figure(figsize=(8.4, 9.4), dpi=110, layout="constrained")
    figure.suptitle(
        "What speed costs: the default whisker over a stamped groove, 5 mm characters", fontsize=11
    )
    grid = figure.add_gridspec(3, 2, height_ratios=(1.3, 1.0, 1.0))
    axes = figure.add_subplot(grid[0, :])
    for k, (speed, colour) in enumerate(zip(TRACED_MM_S, _COLOURS, strict=True)):
        x, slow, fast = groove_traces(whisker, touch, speed_mm_s=speed, character_height_mm=HEIGHT_MM)
        axes.plot(x, fast - 0.5 * k, color=colour, lw=1.0)
        axes.plot(x, slow - 0.5 * k, color="0.4", lw=0.7, ls="--")
        axes.annotate(
            f"{speed:g} mm/s", (x[-1], 1.0 - 0.5 * k), xytext=(-2, 5), textcoords="offset points", ha="right",
            fontsize=8, color=colour,
        )  # fmt: skip
    axes.set_xlabel("along the trace, mm; walls of 45°", fontsize=9)
    axes.set_ylabel("moment / land's, each 0.5 lower", fontsize=9)
    axes.set_title("dashed: slow stage", fontsize=9, loc="left")
    error = figure.add_subplot(grid[1, :])
    _panel(error, "error of the edge map, % of the signal", _of(costs, lambda c: 100.0 * c.error))
    ringing = _of(costs, lambda c: 100.0 * c.ringing)
    _panel(figure.add_subplot(grid[2, 0]), "ringing behind, % of the land's", ringing)
    in_air = _of(costs, lambda c: max(c.in_air_mm, _LEAST_MM))
    _panel(figure.add_subplot(grid[2, 1]), "not touched, mm (0: at the foot)", in_air)
    error.axhline(100.0 * FINE_ERROR, color="0.5", lw=0.8, ls="--")
    error.axvline(SAFE_SPEED_MM_S, color="0.5", lw=0.8, ls=":")
    error.annotate(
        "usual speed",
        (SAFE_SPEED_MM_S, error.get_ylim()[0]),
        xytext=(3, 4),
        textcoords="offset points",
        fontsize=8,
    )
    return Drawing(figure)


def _of(costs: dict[float, list[SpeedCost]], value: Callable[[SpeedCost], float]) -> dict[float, list[float]]:
    return {bevel: [value(c) for c in one] for bevel, one in costs.items()}


def _panel(axes: Axes, name: str, values: dict[float, list[float]]) -> None:
    for (bevel, one), colour in zip(values.items(), _COLOURS, strict=False):
        axes.plot(SPEEDS_MM_S, np.array(one), "o-", ms=3, lw=1.2, color=colour, label=f"{bevel:g}°")
    axes.set_xscale("log")
    axes.set_yscale("log")
    ticks = [v for v in SPEEDS_MM_S if v in (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)]
    axes.set_xticks(ticks, [f"{v:g}" for v in ticks])
    axes.minorticks_off()
    axes.tick_params(labelsize=8)
    axes.set_xlabel("mm/s", fontsize=9)
    axes.set_title(name, fontsize=9, loc="left")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, title="walls", title_fontsize=8)
