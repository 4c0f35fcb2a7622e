"""How wrong the linear beam is: force, moment and tip place against deflection, beside the exact solution."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from whisker_array.whisker.elastica import large_deflection, linear_error
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.validity import DEFLECTION_LIMIT

L1_MM, L2_MM, WIRE_MM = 30.0, 2.5, 0.3
MOST_LIFT_MM = 8.0
_SHOWN_MM = (1.0, 3.0, 5.0, 8.0)


def elastica_figure(settings: FigureSettings) -> Drawing:
    """The paper's whisker (k = 0.083, 0.3 mm wire) pushed straight up at its tip, by up to 8 mm.

    Raises:
        ElasticaError: the exact solution does not converge.
    """
    whisker = LShaped(L1_MM, L2_MM, None, 0.0, Round(WIRE_MM))
    lifts = np.linspace(0.25, MOST_LIFT_MM, 32)
    errors = [linear_error(whisker, lift_mm=float(lift)) for lift in lifts]
    exact = [large_deflection(whisker, lift_mm=float(lift)) for lift in lifts]
    tip = whisker.tip_model().compliance_mm_per_n
    figure = Figure(figsize=(11.0, 6.6), dpi=110, layout="constrained")
    figure.suptitle(
        f"How wrong is the linear beam? l1 = {L1_MM:g}, l2 = {L2_MM:g} mm, {WIRE_MM:g} mm wire, no friction",
        fontsize=11,
    )
    panels = figure.subplots(2, 2)
    axes = panels[0, 0]
    axes.plot(lifts, [100.0 * e.force for e in errors], color="#0072B2", label="force")
    axes.plot(lifts, [100.0 * e.moment for e in errors], "--", color="#D55E00", label="moment at the sensor")
    axes.set_ylabel("linear less exact, %")
    axes = panels[0, 1]
    axes.plot(lifts, [-e.tip_shift_mm[0] for e in exact], color="#0072B2", label="exact")
    axes.plot(lifts, -lifts * tip[0, 1] / tip[1, 1], "--", color="0.4", label="linear")
    axes.set_ylabel("tip moves away from the base, mm")
    axes = panels[1, 0]
    axes.plot(lifts, [e.force_n[1] for e in exact], color="#0072B2", label="exact")
    axes.plot(lifts, lifts / tip[1, 1], "--", color="0.4", label="linear")
    axes.set_ylabel("force, N")
    for axes in (panels[0, 0], panels[0, 1], panels[1, 0]):
        axes.axvspan(DEFLECTION_LIMIT * L1_MM, MOST_LIFT_MM, color="0.93", zorder=0)
        axes.set_xlabel("tip pushed up, mm (grey: over 10 % of l1)")
        axes.axhline(0.0, color="0.7", linewidth=0.8)
        axes.legend(fontsize=8)
    axes = panels[1, 1]
    for lift, shade in zip((0.0, *_SHOWN_MM), np.linspace(0.75, 0.0, 1 + len(_SHOWN_MM)), strict=True):
        shape = (
            large_deflection(whisker, lift_mm=lift).shape_mm
            if lift
            else np.array([[0.0, 0.0], [-L1_MM, 0.0], [-L1_MM, -L2_MM]])
        )
        axes.plot(shape[:, 0], shape[:, 1], color=str(shade), label=f"{lift:g} mm")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, mm (clamp at 0)")
    axes.set_ylabel("y, mm")
    axes.legend(fontsize=8, title="pushed up", title_fontsize=8, loc="upper right")
    return Drawing(figure)
