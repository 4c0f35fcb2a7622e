"""Draw Figs. 4, 6 and 7 of the paper from simulated traces: `python docs/paper_figures.py FOLDER [MU]`.

MU is the friction in Figs. 6 and 7 (default: 0.2). The steps are written beside the pictures, as figures.csv.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_steps import DEPTH_MM, L1_MM, PRELOAD_MM, TIP_RADIUS_MM, Step, feel_step, paper_whisker

from pipeline.common.output_paths import make_folder, write_table
from pipeline.plots.pictures import BLUE, VERMILION, note, save_figure, styled
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.enhancement import moment_ratio

PANELS = (("4a", 0.033), ("4b", 0.117))
FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
TRACED_FRICTIONS = (0.0, 0.2, 0.5)
TRACED_ANGLES_DEG = (15.0, 30.0, 45.0, 60.0)
PIECES_DEG, PIECES_K = (30.0, 45.0, 60.0), 0.083
WHISKERS_DEG, WHISKERS_K = 60.0, (0.0, 0.033, 0.083, 0.117)
_MARKS = {Fidelity.POINTWISE: ("o", 8.5), Fidelity.CONTACT: ("x", 6.0)}
_LINES: dict[Fidelity, dict[str, Any]] = {
    Fidelity.POINTWISE: {"color": BLUE, "alpha": 0.6, "linewidth": 3.2},
    Fidelity.CONTACT: {"color": VERMILION, "linewidth": 1.4},
}
# a figure, and its steps with the numbers of their panels
Drawn = tuple[Figure, list[tuple[str, Step]]]


def draw_figures(folder: Path, *, mu: float = 0.2) -> list[Path]:
    """Draw the figures into a folder, made if missing, and write their steps beside them.

    `mu` is the friction in Figs. 6 and 7; Fig. 4 has the paper's range of them.
    """
    make_folder(folder)
    written, rows = [], []
    for name, (figure, steps) in (
        ("fig4-factor", factor_figure()),
        ("fig6-test-pieces", pieces_figure(mu)),
        ("fig7-whiskers", whiskers_figure(mu)),
    ):
        written.append(folder / f"{name}.png")
        save_figure(figure, written[-1])
        rows += [{"figure": number} | step.row() for number, step in steps]
    written.append(folder / "figures.csv")
    lines = ([float(f"{v:.6g}") if isinstance(v, float) else v for v in row.values()] for row in rows)
    write_table(written[-1], [list(rows[0]), *lines])
    return written


@styled
def factor_figure() -> Drawn:
    """Draw Fig. 4: F against the intersection angle by eq. (16), and the steps read off simulated traces."""
    figure = Figure(figsize=(10.0, 5.0))
    figure.suptitle(
        "Fig. 4  Edge enhancement factor F of the L-shaped whisker (β = 0, l3 = l2); mind the two scales of F"
    )
    # dark to light with rising friction; the lightest is still legible on white
    colours = {mu: colormaps["viridis"](0.85 * mu / FRICTIONS[-1]) for mu in FRICTIONS}
    alpha_deg = np.linspace(0.0, 60.0, 241)
    steps = []
    left, right = figure.subplots(1, 2)
    for axes, (name, k) in zip((left, right), PANELS, strict=True):
        tip = paper_whisker(k).tip_model()
        for mu, colour in colours.items():
            factor = moment_ratio(-np.tan(np.radians(alpha_deg)), mu, tip)
            axes.plot(alpha_deg, factor, color=colour, linewidth=1.6, label=f"μ = {mu:g}")
        for mu, alpha, fidelity in product(TRACED_FRICTIONS, TRACED_ANGLES_DEG, Fidelity):
            step = feel_step(k, alpha, mu, fidelity)
            marker, size = _MARKS[fidelity]
            axes.plot(
                alpha, step.reading.factor, marker, markersize=size, mfc="none", mew=1.3, color=colours[mu]
            )
            steps.append((name, step))
        axes.axhline(1.0, color="0.5", linewidth=0.8, linestyle=":")
        axes.grid()
        axes.set(
            xlim=(0.0, 62.0),
            xticks=range(0, 61, 15),
            xlabel="intersection angle α, degrees",
            ylabel="F = m on the slope / m on the land",
            title=f"({name[-1]})  l2/l1 = {k:g}",
        )
    left.legend(title="eq. (16)", loc="upper left")
    marks = [
        right.plot([], [], marker, color="0.2", mfc="none", label=fidelity.value)[0]
        for fidelity, (marker, _) in _MARKS.items()
    ]
    right.legend(handles=marks, title="step read off a trace", loc="upper left")
    return figure, steps


def pieces_figure(mu: float) -> Drawn:
    """Draw Fig. 6: one whisker, l2/l1 = 0.083, over the test pieces of 30, 45 and 60 degrees."""
    panels = {f"α = {alpha:g}°": (PIECES_K, alpha) for alpha in PIECES_DEG}
    title = f"Fig. 6  Three test pieces, l2/l1 = {PIECES_K:g}"
    return _draw_traces("6", title, panels, mu, view_mm=(-0.4, 1.25), panel_in=3.1)


def whiskers_figure(mu: float) -> Drawn:
    """Draw Fig. 7: the 60 degree test piece under four whiskers, l2/l1 = 0, 0.033, 0.083 and 0.117."""
    panels = {f"l2/l1 = {k:g}": (k, WHISKERS_DEG) for k in WHISKERS_K}
    title = f"Fig. 7  Four whiskers on the test piece of α = {WHISKERS_DEG:g}°"
    return _draw_traces("7", title, panels, mu, view_mm=(-0.3, 0.75), panel_in=2.45)


@styled
def _draw_traces(
    number: str,
    title: str,
    panels: dict[str, tuple[float, float]],
    mu: float,
    *,
    view_mm: tuple[float, float],
    panel_in: float,
) -> Drawn:
    figure = Figure(figsize=(panel_in * len(panels) + 0.6, 5.4))
    figure.suptitle(
        f"{title}\nβ = 0, l3 = l2, l1 = {L1_MM:g} mm, μ = {mu:g}, preload {PRELOAD_MM:g} mm, "
        f"ball radius {TIP_RADIUS_MM:g} mm"
    )
    upper, lower = figure.subplots(2, len(panels), sharex=True, sharey="row", height_ratios=[3.2, 1.0])
    x_mm, drawn = np.linspace(*view_mm, 600), []
    for above, below, letter, (heading, (k, alpha)) in zip(
        upper, lower, "abcd", panels.items(), strict=False
    ):
        steps = [feel_step(k, alpha, mu, fidelity) for fidelity in Fidelity]
        drawn += [(number, step) for step in steps]
        _trace_panel(above, steps, view_mm)
        above.set(xlim=view_mm, title=f"({letter})  {heading}")
        height = steps[0].wedge.height_mm(x_mm)
        below.fill_between(x_mm, height, -1.5 * DEPTH_MM, color="0.8", linewidth=0.0)
        below.plot(x_mm, height, color="0.25", linewidth=1.2)
        below.set(ylim=(-1.3 * DEPTH_MM, 0.3 * DEPTH_MM), xlabel="place after the edge, mm")
    # head room for the numbers in the corner, whatever the highest step is
    highest = max(step.reading.factor for _, step in drawn)
    upper[0].set(ylim=(0.45, highest + 0.4 * (highest - 1.0) + 0.11), ylabel="moment / moment on the land")
    lower[0].set_ylabel("height, mm")
    figure.legend(handles=upper[0].get_legend_handles_labels()[0], loc="outside lower center", ncols=4)
    return figure, drawn


def _trace_panel(axes: Axes, steps: Sequence[Step], view_mm: tuple[float, float]) -> None:
    """Draw each trace, and the line fitted to its slope, from the foot back to the height of the land."""
    axes.axhline(1.0, color="0.55", linewidth=0.8, linestyle=":")
    note(axes, "land level", (view_mm[1], 1.0), (-4, 3), color="0.4", ha="right")
    numbers = [("eq. (16)", steps[0].predicted, "black")]
    for step in steps:
        reading, line = step.reading, _LINES[step.fidelity]
        axes.plot(
            step.place_mm, step.moment_n_mm / reading.land_n_mm, label=f"{step.fidelity.value} trace", **line
        )
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


if __name__ == "__main__":
    for path in draw_figures(Path(sys.argv[1]), mu=float(sys.argv[2]) if sys.argv[2:] else 0.2):
        print(f"wrote {path}")
