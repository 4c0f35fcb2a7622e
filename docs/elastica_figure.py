"""Error of the linear beam: force, moment and tip place against deflection, beside the exact solution."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pipeline.plots.pictures import BLUE, VERMILION, styled
from whisker_array.whisker.elastica import large_deflection, linear_error
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.validity import DEFLECTION_LIMIT


@styled
def elastica_figure() -> Figure:
    """Draw the paper's whisker (k = 0.083, 0.3 mm wire) pushed straight up at its tip, by up to 8 mm.

    Raises:
        ElasticaError: the exact solution does not converge.
    """
    l1, l2, wire, most, shown = 30.0, 2.5, 0.3, 8.0, (1.0, 3.0, 5.0, 8.0)
    whisker = LShaped(l1, l2, None, 0.0, Round(wire))
    lifts = np.linspace(0.25, most, 32)
    errors = [linear_error(whisker, lift_mm=float(lift)) for lift in lifts]
    exact = [large_deflection(whisker, lift_mm=float(lift)) for lift in lifts]
    compliance = whisker.tip_model().compliance_mm_per_n
    figure = Figure(figsize=(11.0, 6.6))
    figure.suptitle(
        f"How wrong is the linear beam? l1 = {l1:g}, l2 = {l2:g} mm, {wire:g} mm wire, no friction"
    )
    (share, shift), (force, shapes) = figure.subplots(2, 2)
    share.set_ylabel("linear less exact, %")
    share.plot(lifts, [100.0 * e.force for e in errors], color=BLUE, label="force")
    share.plot(lifts, [100.0 * e.moment for e in errors], "--", color=VERMILION, label="moment at the sensor")
    for axes, label, true, linear in (
        (
            shift,
            "tip moves away from the base, mm",
            [-e.tip_shift_mm[0] for e in exact],
            -compliance[0, 1] / compliance[1, 1],
        ),
        (force, "force, N", [e.force_n[1] for e in exact], 1.0 / compliance[1, 1]),
    ):
        axes.set_ylabel(label)
        axes.plot(lifts, true, color=BLUE, label="exact")
        axes.plot(lifts, lifts * linear, "--", color="0.4", label="linear")
    for axes in (share, shift, force):
        axes.axvspan(DEFLECTION_LIMIT * l1, most, color="0.93", zorder=0)
        axes.axhline(0.0, color="0.7", linewidth=0.8)
        axes.set_xlabel("tip pushed up, mm (grey: over 10 % of l1)")
        axes.legend()
    bent = [(0.0, np.array([[0.0, 0.0], [-l1, 0.0], [-l1, -l2]]))]
    bent += [(lift, large_deflection(whisker, lift_mm=lift).shape_mm) for lift in shown]
    for (lift, line), shade in zip(bent, np.linspace(0.75, 0.0, len(bent)), strict=True):
        shapes.plot(*line.T[:2], color=str(shade), label=f"{lift:g} mm")
    shapes.set(xlabel="x, mm (clamp at 0)", ylabel="y, mm")
    shapes.set_aspect("equal", adjustable="datalim")
    shapes.legend(title="pushed up", loc="upper right")
    return figure
