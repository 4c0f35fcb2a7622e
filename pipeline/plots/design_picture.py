"""Draw designs as charts: F against the wall's inclination, trade-offs, stage seconds against whiskers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from pipeline.plots.pictures import STEEL, VERMILION, note, styled
from whisker_array.design.array_design import ArrayChoice, ArrayRequest
from whisker_array.design.checks import factors
from whisker_array.design.design import Design
from whisker_array.design.trade import TradeOff
from whisker_array.design.tuned import Tuned, middle_friction

_CURVES = ("#9ec5e8", "#4a86c5", "#173f6b")


@styled
def design_figure(design: Design, *, trades: Sequence[TradeOff] = (), tuned: Tuned | None = None) -> Figure:
    """Draw F against the wall's inclination, and the trade-offs."""
    panels = 1 + len(trades)
    figure = Figure(figsize=(max(6.5, 4.5 * panels), 4.0))
    first, *others = figure.subplots(1, panels, squeeze=False)[0]
    _factor_panel(first, design, tuned)
    for axes, trade in zip(others, trades, strict=True):
        _trade_panel(axes, trade)
    return figure


def _factor_panel(axes: Axes, design: Design, tuned: Tuned | None) -> None:
    request, worst = design.request, design.worst
    mus = (request.mu[0], middle_friction(request.mu), request.mu[1])
    low, high = (math.degrees(alpha) for alpha in request.alpha_rad)
    degrees = np.linspace(-high, high, 241) if tuned is None else np.linspace(0.0, 70.0, 241)
    values = factors(design.whisker, alpha_rad=np.radians(degrees), mu=np.array(mus))
    for curve, mu, colour in zip(values.T, mus, _CURVES, strict=True):
        axes.plot(degrees, curve, color=colour, linewidth=1.6, label=f"µ = {mu:.2g}")
    axes.axhline(1.0, color="0.6", linewidth=0.7)
    axes.set(xlabel="α, degrees; falling walls positive", ylabel="F = moment on the wall / on the land")
    if tuned is None:
        for span in ((low, high), (-high, -low)):
            axes.axvspan(*span, color="0.93", zorder=0)
        axes.text(
            0.5 * (low + high), 0.98, "requested walls", transform=axes.get_xaxis_transform(), ha="center", va="top",
            color="0.4",
        )  # fmt: skip
        worst_factor = factors(design.whisker, alpha_rad=np.array([worst.alpha_rad]), mu=np.array([worst.mu]))
        axes.plot(math.degrees(worst.alpha_rad), worst_factor[0, 0], "o", color=VERMILION, markersize=5)
        axes.set_title(f"F over the wall (dot: worst, contrast {design.contrast:.3f})")
    else:
        place, finite = math.degrees(tuned.alpha_rad), values[np.isfinite(values)]
        axes.axvline(place, color=VERMILION, linewidth=1.0)
        axes.axvspan(place - 10.0, place + 10.0, color="0.93", zorder=0)
        axes.axhline(0.0, color="0.6", linewidth=0.7)
        axes.set_ylim(max(float(finite.min()), -3.0) - 0.1, min(float(finite.max()), 6.0) + 0.1)
        axes.set_title(f"F over the wall: {tuned.kind.value} at {place:g}°, shaded ±10°")
    axes.legend(loc="upper left" if tuned is None or float(np.nanmax(values)) > 1.5 else "lower left")


def _trade_panel(axes: Axes, trade: TradeOff) -> None:
    allowed = np.array(trade.allowed)
    contrast = np.array([math.nan if c is None else c for c in trade.contrast])
    known, here = np.isfinite(contrast), allowed == trade.at
    axes.semilogx(allowed[known], contrast[known], "o-", color=STEEL, markersize=4, linewidth=1.4)
    axes.plot(allowed[here], contrast[here], "o", color=VERMILION, markersize=7, label="this design")
    if not known.all():
        axes.plot(allowed[~known], np.zeros(np.sum(~known)), "x", color="0.5", label="no whisker")
    axes.set_xticks(allowed, [f"{a:.3g}" for a in allowed], rotation=45)
    axes.minorticks_off()
    axes.grid()
    axes.set(
        ylim=(0.0, 1.15 * max(contrast[known], default=1.0)), xlabel=f"{trade.name}, {trade.unit}",
        ylabel="worst edge contrast", title=f"contrast against {trade.name}",
    )  # fmt: skip
    axes.legend(loc="lower left")


@styled
def array_figure(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> Figure:
    """Draw stage seconds of the arrays, in a narrow chart for phones."""
    figure = Figure(figsize=(5.2, 3.6), dpi=150)
    axes = figure.subplots()
    whiskers, seconds = [c.plan.array.n_whiskers for c in choices], [c.stage_s for c in choices]
    axes.loglog(whiskers, seconds, "o-", color=STEEL, markersize=5, linewidth=1.6)
    for place in zip(whiskers, seconds, strict=True):
        note(axes, f"{place[1]:.1f}", place, (0, 7), ha="center")
    axes.set_xticks(whiskers, [str(n) for n in whiskers])
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.grid()
    axes.set(
        ylim=(0.75 * min(seconds), 1.5 * max(seconds)),
        xlabel="whiskers",
        ylabel="stage seconds a serial",
        title=f"{100 * request.accuracy:g} % of characters at dirt {request.severity:g}, "
        f"{request.character_height_mm:g} mm high",
    )
    return figure
