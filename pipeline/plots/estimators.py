"""Errors of friction, slope and depth as a mixed array estimates them, with sensor noise on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.drawing import Drawing, FigureSettings
from pipeline.plots.estimator_trial import ANGLES_DEG, TrialRow, try_estimators
from pipeline.plots.pictures import BLUE, GREEN, PURPLE, VERMILION, styled

FRICTIONS = (0.1, 0.3, 0.5)
_COLOURS = dict(zip(ANGLES_DEG, (BLUE, GREEN, VERMILION), strict=True))
_SHAPES = {
    "none": ("x", "L-shaped alone"),
    "raised sensor": ("o", "L with its sensor raised by l2/2"),
    "straight": ("s", "straight"),
}
_SCANS = 3


@styled
def estimators_figure(settings: FigureSettings) -> Drawing:
    """Draw bias and standard deviation over mu and alpha, contact fidelity."""
    rows = try_estimators(frictions=FRICTIONS, scans=_SCANS, seed=settings.seed)
    figure = Figure(figsize=(11.0, 6.8))
    figure.suptitle(
        "Estimates from the moments: errors over μ 0.1 to 0.5 and α 30° to 60°, contact, sensors as from the bench\n"
        "(noise, vibration, drift, 16 bits, creep and hysteresis as the bench knows them; markers: bias, bars: "
        "standard deviation)"
    )
    (friction, slope), (depth, alone) = figure.subplots(2, 2)
    for name, label, colour, aside in (
        ("friction", "dragged and pushed back (no gain needed)", BLUE, -0.008),
        ("shapes", "ratio of the shapes, gains known to 0.1 %", PURPLE, 0.008),
    ):
        chosen = [
            [r for r in rows if r.mu == mu and np.isfinite(getattr(r, f"{name}_bias"))] for mu in FRICTIONS
        ]
        bias = [np.mean([getattr(r, f"{name}_bias") for r in some]) for some in chosen]
        spread = [np.sqrt(np.mean([getattr(r, f"{name}_sd") ** 2 for r in some])) for some in chosen]
        friction.errorbar(
            np.add(FRICTIONS, aside),
            bias,
            spread,
            fmt="o",
            color=colour,
            capsize=3,
            markersize=5,
            label=label,
        )
    _dress(friction, "friction of the land", "error of μ", room=0.25, columns=1)
    mixed, single = ([r for r in rows if (r.profiler == "none") is only] for only in (False, True))
    angle = "error of the wall's angle, degrees"
    _errors(slope, mixed, "slope_{}_deg", "slope, from profilers and L-shaped", angle)
    _errors(depth, rows, "depth_{}_um", "depth of a floor 500 µm deep", "error of the floor's depth, µm")
    _errors(alone, single, "slope_{}_deg", "slope, L-shaped alone turned about, μ taken for 0.2", angle)
    return Drawing(figure, trial=rows)


def _errors(axes: Axes, rows: Sequence[TrialRow], field: str, title: str, label: str) -> None:
    """Draw errors over friction: arrays and angles side by side; `field` has a gap for "bias" and "sd"."""
    shapes = [name for name in _SHAPES if any(r.profiler == name for r in rows)]
    count = len(shapes) * len(ANGLES_DEG)
    for k, angle in enumerate(ANGLES_DEG):
        for j, shape in enumerate(shapes):
            some = [r for r in rows if (r.alpha_deg, r.profiler) == (angle, shape)]
            place = np.array([r.mu for r in some]) + 0.014 * (k * len(shapes) + j - 0.5 * (count - 1))
            bias, spread = ([getattr(r, field.format(of)) for r in some] for of in ("bias", "sd"))
            axes.errorbar(
                place,
                bias,
                spread,
                fmt=_SHAPES[shape][0],
                color=_COLOURS[angle],
                markersize=5,
                mfc="none",
                capsize=2,
            )
    for shape in shapes:
        axes.plot([], [], _SHAPES[shape][0], color="0.3", mfc="none", label=_SHAPES[shape][1])
    for angle, colour in _COLOURS.items():
        axes.plot([], [], "-", color=colour, label=f"α = {angle:g}°")
    _dress(axes, title, label, room=0.4)


def _dress(axes: Axes, title: str, label: str, *, room: float, columns: int = 2) -> None:
    """Label the axes; `room` for the legend above, as a share of the data's height."""
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    low, high = axes.get_ylim()
    axes.set(
        ylim=(low, high + room * (high - low)),
        xticks=FRICTIONS,
        xlabel="true friction μ",
        ylabel=label,
        title=title,
    )
    axes.legend(ncols=columns, loc="upper left")
