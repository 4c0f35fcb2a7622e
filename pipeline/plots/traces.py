"""Figs. 6 and 7 of the paper: traces over the test pieces, with the step read off and the step predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from pipeline.plots.pictures import BLUE, VERMILION, note, styled
from pipeline.plots.steps import DEPTH_MM, L1_MM, PRELOAD_MM, TIP_RADIUS_MM, FeltStep, StepCase, feel_step
from whisker_array.simulation.traces import Fidelity

PIECES_DEG, PIECES_K = (30.0, 45.0, 60.0), 0.083
WHISKERS_DEG, WHISKERS_K = 60.0, (0.0, 0.033, 0.083, 0.117)
_LINES: dict[Fidelity, dict[str, Any]] = {
    Fidelity.POINTWISE: {"color": BLUE, "alpha": 0.6, "linewidth": 3.2},
    Fidelity.CONTACT: {"color": VERMILION, "linewidth": 1.4},
}


def pieces_figure(settings: FigureSettings) -> Drawing:
    """Draw Fig. 6: one whisker, l2/l1 = 0.083, over the test pieces of 30, 45 and 60 degrees.

    Raises:
        StepError: a step cannot be read off.
    """
    panels = {f"α = {alpha:g}°": StepCase(PIECES_K, alpha, settings.mu) for alpha in PIECES_DEG}
    title = f"Fig. 6  Three test pieces, l2/l1 = {PIECES_K:g}"
    return _draw("6", title, panels, settings, view_mm=(-0.4, 1.25), panel_in=3.1)


def whiskers_figure(settings: FigureSettings) -> Drawing:
    """Draw Fig. 7: the 60 degree test piece under four whiskers, l2/l1 = 0, 0.033, 0.083 and 0.117.

    Raises:
        StepError: a step cannot be read off.
    """
    panels = {f"l2/l1 = {k:g}": StepCase(k, WHISKERS_DEG, settings.mu) for k in WHISKERS_K}
    title = f"Fig. 7  Four whiskers on the test piece of α = {WHISKERS_DEG:g}°"
    return _draw("7", title, panels, settings, view_mm=(-0.3, 0.75), panel_in=2.45)


@styled
def _draw(
    name: str,
    title: str,
    panels: Mapping[str, StepCase],
    settings: FigureSettings,
    *,
    view_mm: tuple[float, float],
    panel_in: float,
) -> Drawing:
    """Draw a trace above its test piece in each column; the moments share their axis."""
    figure = Figure(figsize=(panel_in * len(panels) + 0.6, 5.4))
    setting = (
        f"β = 0, l3 = l2, l1 = {L1_MM:g} mm, μ = {settings.mu:g}, preload {PRELOAD_MM:g} mm, "
        f"ball radius {TIP_RADIUS_MM:g} mm"
    )
    if settings.noise > 0.0:
        setting += f", noise {100.0 * settings.noise:g} % of the land's moment"
    figure.suptitle(f"{title}\n{setting}")
    upper, lower = figure.subplots(
        2, len(panels), sharex=True, sharey="row", squeeze=False, height_ratios=[3.2, 1.0]
    )
    x_mm, rows = np.linspace(*view_mm, 600), []
    for column, (heading, case) in enumerate(panels.items()):
        steps = [feel_step(case, fidelity, settings) for fidelity in Fidelity]
        _trace_panel(upper[column], steps, view_mm)
        upper[column].set(xlim=view_mm, title=f"({'abcd'[column]})  {heading}")
        height = steps[0].wedge.height_mm(x_mm)
        lower[column].fill_between(x_mm, height, -1.5 * DEPTH_MM, color="0.8", linewidth=0.0)
        lower[column].plot(x_mm, height, color="0.25", linewidth=1.2)
        lower[column].set(ylim=(-1.3 * DEPTH_MM, 0.3 * DEPTH_MM), xlabel="place after the edge, mm")
        rows += [step.row(name) for step in steps]
    # head room for the numbers in the corner, whatever the highest step is
    highest = max(row.f_read_off for row in rows)
    upper[0].set(ylim=(0.45, highest + 0.4 * (highest - 1.0) + 0.11), ylabel="moment / moment on the land")
    lower[0].set_ylabel("height, mm")
    figure.legend(handles=upper[0].get_legend_handles_labels()[0], loc="outside lower center", ncols=4)
    return Drawing(figure, tuple(rows))


def _trace_panel(axes: Axes, steps: Sequence[FeltStep], view_mm: tuple[float, float]) -> None:
    """Draw each trace, and the line on its slope from the foot back to where the height is that of the land."""
    axes.axhline(1.0, color="0.55", linewidth=0.8, linestyle=":")
    note(axes, "land level", (view_mm[1], 1.0), (-4, 3), color="0.4", ha="right")
    numbers = [("eq. (16)", steps[0].predicted, "black")]
    for step in steps:
        reading, line = step.reading, _LINES[step.fidelity]
        seen = (step.place_mm >= view_mm[0]) & (step.place_mm <= view_mm[1])
        moment = step.moment_n_mm[seen] / reading.land_n_mm
        axes.plot(step.place_mm[seen], moment, label=f"{step.fidelity.value} trace", **line)
        rise, start = reading.line
        ends = np.array([reading.edge_mm, reading.foot_mm])
        last = step is steps[-1]
        axes.plot(
            ends, start + rise * ends, color="black", linewidth=0.9, linestyle=(0, (4, 2)), zorder=3,
            label="straight line fitted to the slope" if last else None,
        )  # fmt: skip
        axes.plot(
            reading.edge_mm, reading.factor, "o", mfc="white", mec=line["color"], mew=1.4, zorder=3,
            label="its value at the land's height: F" if last else None,
        )  # fmt: skip
        numbers.append((step.fidelity.value, reading.factor, line["color"]))
    for row, (label, value, colour) in enumerate(numbers):
        axes.text(
            0.97, 0.97 - 0.06 * row, f"{label}  F = {value:.3f}", transform=axes.transAxes, va="top", ha="right",
            color=colour, fontsize=9,
        )  # fmt: skip
