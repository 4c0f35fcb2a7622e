"""Fig. 4 of the paper: the edge enhancement factor F over the intersection angle, for several frictions."""

from __future__ import annotations

from itertools import product

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pipeline.plots.drawing import Drawing, FigureSettings
from pipeline.plots.steps import FeltStep, StepCase, feel_step, paper_whisker
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.enhancement import moment_ratio

PANELS = (("4a", 0.033), ("4b", 0.117))
FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
TRACED_FRICTIONS = (0.0, 0.2, 0.5)
TRACED_ANGLES_DEG = (15.0, 30.0, 45.0, 60.0)
_MOST_DEG = 60.0
_MARKERS = {Fidelity.POINTWISE: "o", Fidelity.CONTACT: "x"}


def factor_figure(settings: FigureSettings) -> Drawing:
    """Curves of eq. (16), and on them the steps read off simulated traces. The frictions are the paper's.

    Raises:
        StepError: a step cannot be read off.
    """
    figure = Figure(figsize=(10.0, 5.0), dpi=110, layout="constrained")
    figure.suptitle(
        "Fig. 4  Edge enhancement factor F of the L-shaped whisker (β = 0, l3 = l2); mind the two scales of F",
        fontsize=11,
    )
    rows = []
    panels = figure.subplots(1, 2)
    for axes, (name, k) in zip(panels, PANELS, strict=True):
        steps = [
            feel_step(StepCase(k, alpha, mu), fidelity, settings)
            for mu, alpha, fidelity in product(TRACED_FRICTIONS, TRACED_ANGLES_DEG, Fidelity)
        ]
        _curves(axes, k)
        _marks(axes, steps)
        axes.set_title(f"({name[-1]})  l2/l1 = {k:g}", fontsize=11, loc="left")
        rows += [step.row(name) for step in steps]
    _legends(panels[0], panels[1])
    return Drawing(figure, tuple(rows))


def _colour(mu: float) -> tuple[float, float, float, float]:
    """Dark to light with rising friction; the lightest is still legible on white."""
    red, green, blue, alpha = colormaps["viridis"](0.85 * mu / FRICTIONS[-1])
    return (red, green, blue, alpha)


def _curves(axes: Axes, k: float) -> None:
    alpha_deg = np.linspace(0.0, _MOST_DEG, 241)
    tip = paper_whisker(k).tip_model()
    for mu in FRICTIONS:
        factor = moment_ratio(-np.tan(np.radians(alpha_deg)), mu, tip)
        axes.plot(alpha_deg, factor, color=_colour(mu), linewidth=1.6)
    axes.axhline(1.0, color="0.5", linewidth=0.8, linestyle=":")
    axes.set_xlim(0.0, _MOST_DEG + 2.0)
    axes.set_xticks(range(0, 61, 15))
    axes.set_xlabel("intersection angle α, degrees")
    axes.set_ylabel("F = m on the slope / m on the land")
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


def _marks(axes: Axes, steps: list[FeltStep]) -> None:
    for step in steps:
        axes.plot(
            step.case.alpha_deg,
            step.reading.factor,
            linestyle="none",
            marker=_MARKERS[step.fidelity],
            markersize=8.5 if step.fidelity is Fidelity.POINTWISE else 6.0,
            markerfacecolor="none",
            markeredgewidth=1.3,
            color=_colour(step.case.mu),
        )


def _legends(left: Axes, right: Axes) -> None:
    curves = [Line2D([], [], color=_colour(mu), linewidth=1.8, label=f"μ = {mu:g}") for mu in FRICTIONS]
    left.legend(handles=curves, title="eq. (16)", loc="upper left", fontsize=9, title_fontsize=9)
    marks = [
        Line2D([], [], color="0.2", linestyle="none", marker=marker, markerfacecolor="none", markersize=7,
               label=fidelity.value)
        for fidelity, marker in _MARKERS.items()
    ]  # fmt: skip
    right.legend(handles=marks, title="step read off a trace", loc="upper left", fontsize=9, title_fontsize=9)
