"""Errors of friction, slope and depth as a mixed array finds them, with sensor noise on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from pipeline.plots.estimator_trial import ANGLES_DEG, TrialRow, try_estimators

FRICTIONS = (0.1, 0.3, 0.5)
_COLOURS = {30.0: "#0072B2", 45.0: "#009E73", 60.0: "#D55E00"}
_MARKERS = {"straight": "s", "raised sensor": "o", "none": "x"}
_NAMES = {
    "straight": "straight",
    "raised sensor": "L with its sensor raised by l2/2",
    "none": "L-shaped alone",
}
_SCANS = 3


def estimators_figure(settings: FigureSettings) -> Drawing:
    """Bias and standard deviation over mu and alpha, contact fidelity."""
    rows = try_estimators(frictions=FRICTIONS, scans=_SCANS, seed=settings.seed)
    figure = Figure(figsize=(11.0, 6.8), dpi=110, layout="constrained")
    figure.suptitle(
        "What the moments tell: errors over μ 0.1 to 0.5 and α 30° to 60°, contact, sensors as from the bench\n"
        "(noise, vibration, drift, 16 bits, creep and hysteresis as the bench knows them; markers: bias, bars: "
        "standard deviation)",
        fontsize=11,
    )
    panels = figure.subplots(2, 2)
    _friction(panels[0, 0], rows)
    mixed = [row for row in rows if row.profiler != "none"]
    _errors(panels[0, 1], mixed, "slope", "error of the wall's angle, degrees")
    panels[0, 1].set_title("slope, from profilers and L-shaped", fontsize=10, loc="left")
    _errors(panels[1, 0], rows, "depth", "error of the floor's depth, µm")
    panels[1, 0].set_title("depth of a floor 500 µm deep", fontsize=10, loc="left")
    _errors(
        panels[1, 1], [r for r in rows if r.profiler == "none"], "slope", "error of the wall's angle, degrees"
    )
    panels[1, 1].set_title("slope, L-shaped alone turned about, μ taken for 0.2", fontsize=10, loc="left")
    return Drawing(figure, trial=rows)


def _places(rows: Sequence[TrialRow], row: TrialRow) -> float:
    """Where a row stands over its friction: shapes and angles side by side."""
    shapes = sorted({r.profiler for r in rows})
    count = len(shapes) * len(ANGLES_DEG)
    index = ANGLES_DEG.index(row.alpha_deg) * len(shapes) + shapes.index(row.profiler)
    return row.mu + 0.014 * (index - 0.5 * (count - 1))


def _errors(axes: Axes, rows: Sequence[TrialRow], what: str, label: str) -> None:
    unit = "_deg" if what == "slope" else "_um"
    for row in rows:
        axes.errorbar(
            _places(rows, row),
            getattr(row, f"{what}_bias{unit}"),
            getattr(row, f"{what}_sd{unit}"),
            fmt=_MARKERS[row.profiler],
            color=_COLOURS[row.alpha_deg],
            markersize=5,
            markerfacecolor="none",
            capsize=2,
        )
    _dress(axes, rows, label)
    for profiler in sorted({r.profiler for r in rows}):
        axes.plot([], [], _MARKERS[profiler], color="0.3", markerfacecolor="none", label=_NAMES[profiler])
    for angle, colour in _COLOURS.items():
        axes.plot([], [], "-", color=colour, label=f"α = {angle:g}°")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))  # room for the legend
    axes.legend(fontsize=7.5, ncols=2, loc="upper left")


def _friction(axes: Axes, rows: Sequence[TrialRow]) -> None:
    routes = (
        ("friction", "dragged and pushed back (no gain needed)", "#0072B2", -0.008),
        ("shapes", "ratio of the shapes, gains known to 0.1 %", "#CC79A7", 0.008),
    )
    for name, label, colour, aside in routes:
        for mu in FRICTIONS:
            chosen = [r for r in rows if r.mu == mu and np.isfinite(getattr(r, f"{name}_bias"))]
            bias = float(np.mean([getattr(r, f"{name}_bias") for r in chosen]))
            spread = float(np.sqrt(np.mean([getattr(r, f"{name}_sd") ** 2 for r in chosen])))
            axes.errorbar(
                mu + aside,
                bias,
                spread,
                fmt="o",
                color=colour,
                capsize=3,
                markersize=5,
                label=label if mu == FRICTIONS[0] else None,
            )
    _dress(axes, rows, "error of μ")
    axes.set_title("friction of the land", fontsize=10, loc="left")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.25 * (high - low))
    axes.legend(fontsize=7.5, loc="upper left")


def _dress(axes: Axes, rows: Sequence[TrialRow], label: str) -> None:
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.set_xticks(sorted({row.mu for row in rows}))
    axes.set_xlabel("true friction μ", fontsize=9)
    axes.set_ylabel(label, fontsize=9)
    axes.tick_params(labelsize=8)
