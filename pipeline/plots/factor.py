"""Fig. 4 of the paper: the edge enhancement factor F over the intersection angle, for several frictions."""

from __future__ import annotations

from itertools import product

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from pipeline.plots.pictures import styled
from pipeline.plots.steps import StepCase, feel_step, paper_whisker
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.enhancement import moment_ratio

PANELS = (("4a", 0.033), ("4b", 0.117))
FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
TRACED_FRICTIONS = (0.0, 0.2, 0.5)
TRACED_ANGLES_DEG = (15.0, 30.0, 45.0, 60.0)
_MARKS = {Fidelity.POINTWISE: ("o", 8.5), Fidelity.CONTACT: ("x", 6.0)}


@styled
def factor_figure(settings: FigureSettings) -> Drawing:
    """Draw curves of eq. (16), and on them the steps read off simulated traces. The frictions are the paper's.

    Raises:
        StepError: a step cannot be read off.
    """
    figure = Figure(figsize=(10.0, 5.0))
    figure.suptitle(
        "Fig. 4  Edge enhancement factor F of the L-shaped whisker (β = 0, l3 = l2); mind the two scales of F"
    )
    # dark to light with rising friction; the lightest is still legible on white
    colours = {mu: colormaps["viridis"](0.85 * mu / FRICTIONS[-1]) for mu in FRICTIONS}
    alpha_deg = np.linspace(0.0, 60.0, 241)
    rows = []
    left, right = figure.subplots(1, 2)
    for axes, (name, k) in zip((left, right), PANELS, strict=True):
        tip = paper_whisker(k).tip_model()
        for mu, colour in colours.items():
            factor = moment_ratio(-np.tan(np.radians(alpha_deg)), mu, tip)
            axes.plot(alpha_deg, factor, color=colour, linewidth=1.6, label=f"μ = {mu:g}")
        for mu, alpha, fidelity in product(TRACED_FRICTIONS, TRACED_ANGLES_DEG, Fidelity):
            step = feel_step(StepCase(k, alpha, mu), fidelity, settings)
            marker, size = _MARKS[fidelity]
            axes.plot(
                alpha, step.reading.factor, marker, markersize=size, mfc="none", mew=1.3, color=colours[mu]
            )
            rows.append(step.row(name))
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
    return Drawing(figure, tuple(rows))
