"""Figs. 6 and 7 of the paper: traces over the test pieces, with the step read off and the step predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pipeline.plots.drawing import FIDELITY_COLOURS, Drawing, FigureSettings
from pipeline.plots.steps import DEPTH_MM, L1_MM, PRELOAD_MM, TIP_RADIUS_MM, FeltStep, StepCase, feel_step
from whisker_array.simulation.traces import Fidelity

PIECES_DEG = (30.0, 45.0, 60.0)
PIECES_K = 0.083
WHISKERS_K = (0.0, 0.033, 0.083, 0.117)
WHISKERS_DEG = 60.0
_SHADES = {Fidelity.POINTWISE: 0.6, Fidelity.CONTACT: 1.0}
_WIDTHS = {Fidelity.POINTWISE: 3.2, Fidelity.CONTACT: 1.4}


@dataclass(frozen=True)
class _Sheet:
    """Name in the table, title, stretch of the trace shown, and width of a panel in inches."""

    name: str
    title: str
    view_mm: tuple[float, float]
    panel_in: float


def pieces_figure(settings: FigureSettings) -> Drawing:
    """Fig. 6: one whisker, l2/l1 = 0.083, over the test pieces of 30, 45 and 60 degrees.

    Raises:
        StepError: a step cannot be read off.
    """
    panels = [
        (f"({name})  α = {alpha:g}°", StepCase(PIECES_K, alpha, settings.mu))
        for name, alpha in zip("abc", PIECES_DEG, strict=True)
    ]
    sheet = _Sheet("6", f"Fig. 6  Three test pieces, l2/l1 = {PIECES_K:g}", (-0.4, 1.25), 3.1)
    return _draw(sheet, panels, settings)


def whiskers_figure(settings: FigureSettings) -> Drawing:
    """Fig. 7: the 60 degree test piece under four whiskers, l2/l1 = 0, 0.033, 0.083 and 0.117.

    Raises:
        StepError: a step cannot be read off.
    """
    panels = [
        (f"({name})  l2/l1 = {k:g}", StepCase(k, WHISKERS_DEG, settings.mu))
        for name, k in zip("abcd", WHISKERS_K, strict=True)
    ]
    title = f"Fig. 7  Four whiskers on the test piece of α = {WHISKERS_DEG:g}°"
    return _draw(_Sheet("7", title, (-0.3, 0.75), 2.45), panels, settings)


def _draw(sheet: _Sheet, panels: Sequence[tuple[str, StepCase]], settings: FigureSettings) -> Drawing:
    """Trace above, test piece below, one column each; the moments share their axis."""
    figure = Figure(figsize=(sheet.panel_in * len(panels) + 0.6, 5.4), dpi=110, layout="constrained")
    setting = (
        f"β = 0, l3 = l2, l1 = {L1_MM:g} mm, μ = {settings.mu:g}, preload {PRELOAD_MM:g} mm, "
        f"ball radius {TIP_RADIUS_MM:g} mm"
    )
    if settings.noise > 0.0:
        setting += f", noise {100.0 * settings.noise:g} % of the land's moment"
    figure.suptitle(f"{sheet.title}\n{setting}", fontsize=11)
    grid = figure.subplots(2, len(panels), sharex=True, sharey="row", squeeze=False, height_ratios=[3.2, 1.0])
    rows = []
    for column, (heading, case) in enumerate(panels):
        steps = [feel_step(case, fidelity, settings) for fidelity in Fidelity]
        _trace_panel(grid[0, column], steps, sheet.view_mm)
        _piece_panel(grid[1, column], steps[0], sheet.view_mm)
        grid[0, column].set_title(heading, fontsize=11, loc="left")
        rows += [step.row(sheet.name) for step in steps]
    # head room for the figures in the corner, whatever the highest step is
    highest = max(row.f_read_off for row in rows)
    grid[0, 0].set_ylim(0.45, highest + 0.4 * (highest - 1.0) + 0.11)
    grid[0, 0].set_ylabel("moment / moment on the land")
    grid[1, 0].set_ylabel("height, mm")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return Drawing(figure, tuple(rows))


def _trace_panel(axes: Axes, steps: Sequence[FeltStep], view_mm: tuple[float, float]) -> None:
    axes.axhline(1.0, color="0.55", linewidth=0.8, linestyle=":")
    axes.annotate(
        "land level", (view_mm[1], 1.0), xytext=(-4, 3), textcoords="offset points", fontsize=8, color="0.4",
        ha="right",
    )  # fmt: skip
    for step in steps:
        seen = (step.place_mm >= view_mm[0]) & (step.place_mm <= view_mm[1])
        axes.plot(
            step.place_mm[seen],
            step.moment_n_mm[seen] / step.reading.land_n_mm,
            color=FIDELITY_COLOURS[step.fidelity],
            linewidth=_WIDTHS[step.fidelity],
            alpha=_SHADES[step.fidelity],
        )
    for step in steps:
        _read_off(axes, step)
    axes.set_xlim(*view_mm)
    lines = [("eq. (16)", steps[0].predicted, "black")]
    lines += [(s.fidelity.value, s.reading.factor, FIDELITY_COLOURS[s.fidelity]) for s in steps]
    for place, (label, value, colour) in enumerate(lines):
        y = 0.97 - 0.06 * place
        axes.text(
            0.97,
            y,
            f"{label}  F = {value:.3f}",
            transform=axes.transAxes,
            fontsize=9,
            va="top",
            ha="right",
            color=colour,
        )


def _read_off(axes: Axes, step: FeltStep) -> None:
    """The line on the slope, from its foot back to where the height is that of the land."""
    reading = step.reading
    rise, start = reading.line
    ends = np.array([reading.edge_mm, reading.foot_mm])
    axes.plot(ends, start + rise * ends, color="black", linewidth=0.9, linestyle=(0, (4, 2)))
    axes.plot(
        reading.edge_mm, reading.factor, marker="o", markersize=6, markerfacecolor="white",
        markeredgecolor=FIDELITY_COLOURS[step.fidelity], markeredgewidth=1.4,
    )  # fmt: skip


def _piece_panel(axes: Axes, step: FeltStep, view_mm: tuple[float, float]) -> None:
    x = np.linspace(*view_mm, 600)
    height = step.wedge.height_mm(x)
    axes.fill_between(x, height, -1.5 * DEPTH_MM, color="0.8", linewidth=0.0)
    axes.plot(x, height, color="0.25", linewidth=1.2)
    axes.set_ylim(-1.3 * DEPTH_MM, 0.3 * DEPTH_MM)
    axes.set_xlabel("place after the edge, mm")


def _legend() -> list[Line2D]:
    return [
        *(
            Line2D([], [], color=FIDELITY_COLOURS[f], linewidth=_WIDTHS[f], alpha=_SHADES[f],
                   label=f"{f.value} trace")
            for f in Fidelity
        ),
        Line2D([], [], color="black", linewidth=0.9, linestyle=(0, (4, 2)), label="straight line fitted to the slope"),
        Line2D([], [], linestyle="none", marker="o", markerfacecolor="white", markeredgecolor="0.2",
               label="where it stands at the land's height: F"),
    ]  # fmt: skip
