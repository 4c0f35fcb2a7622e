"""A design as a picture: the whisker and its tip to scale, F over the wall's inclination, the trade-offs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import NDArray

from pipeline.common.section_words import describe_section
from pipeline.plots.pictures import GREEN, LAND, PALE, STEEL, VERMILION, note, styled
from whisker_array.design.design import Design
from whisker_array.design.trade import TradeOff
from whisker_array.design.tuned import Tuned, factors, middle_friction
from whisker_array.whisker.elastica import ElasticaError, large_deflection

_CURVES = ("#9ec5e8", "#4a86c5", "#173f6b")


@styled
def design_figure(design: Design, *, trades: Sequence[TradeOff] = (), tuned: Tuned | None = None) -> Figure:
    """Draw whisker, tip and mark, F, and up to two trade-offs."""
    figure = Figure(figsize=(13.0, 7.6))
    grid = figure.add_gridspec(2, 6)
    _whisker_panel(figure.add_subplot(grid[0, :4]), design)
    _tip_panel(figure.add_subplot(grid[0, 4:]), design)
    width = 6 // (1 + len(trades))
    _factor_panel(figure.add_subplot(grid[1, :width]), design, tuned)
    for k, trade in enumerate(trades, start=1):
        _trade_panel(figure.add_subplot(grid[1, k * width : (k + 1) * width]), trade)
    return figure


def _bent_mm(design: Design) -> NDArray[np.float64]:
    """(n, 2) the whisker pressed on the land at middle friction, tip at the origin; unbent if need be."""
    whisker = design.whisker
    try:
        mu = middle_friction(design.request.mu)
        line = large_deflection(whisker, lift_mm=design.preload_mm, mu=mu).shape_mm
    except ElasticaError:
        line = np.array([[0.0, 0.0], *(s.end_mm[:2] for s in whisker.segments())])
    return np.asarray(line - line[-1])


def _draw_whisker(axes: Axes, line: NDArray[np.float64], design: Design, *, colour: str = STEEL) -> None:
    """Draw the arm l1 and the tip arm, which is ground down to its ball."""
    thick_mm = float(design.whisker.segments()[0].section_at(0.0).c_vertical_mm)
    run_mm = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    ground_mm = [design.whisker.l2_mm, 0.0]
    half = np.interp(
        run_mm, run_mm[-1] - np.array(ground_mm), [thick_mm, min(design.request.tip_radius_mm, thick_mm)]
    )
    ahead = np.gradient(line, axis=0)
    side = half[:, None] * np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.hypot(*ahead.T)[:, None]
    outline = np.concatenate([line + side, (line - side)[::-1]])
    axes.add_patch(Polygon(outline, color=colour, linewidth=0.0, zorder=3))


def _whisker_panel(axes: Axes, design: Design) -> None:
    """Draw the whisker on the land, to scale and bent as the exact beam, with its measures beside it."""
    w, line = design.whisker, _bent_mm(design)
    reach, clamp = (float(v) for v in line[0])
    axis, turn = clamp - w.lowered_mm, math.degrees(w.beta_rad)
    low, high = min(0.0, axis) - 0.12 * reach, max(clamp, axis) + 0.15 * reach
    wide = 9.0 * reach
    axes.add_artist(Rectangle((-wide, -wide), 2.0 * wide, wide, color=LAND, zorder=0))
    _draw_whisker(axes, line, design)
    axes.plot(reach, clamp, "s", color="0.5", markersize=11)
    axes.plot([reach, reach], [clamp, axis], color=GREEN, linestyle="--", zorder=1)
    axes.plot(reach, axis, "+", markersize=11, mew=2.0, color=GREEN, zorder=4, clip_on=False)
    note(axes, "clamp", (reach, clamp), (10, 0), va="center")
    note(axes, f"sensor axis, l3 {w.lowered_mm:.2f} mm", (reach, axis), (10, 5), color=GREEN)
    note(axes, f"l2 {w.l2_mm:.2f} mm", (0.0, 0.5 * w.l2_mm), (-6, 3), ha="right")
    arm = {"rotation": turn, "rotation_mode": "anchor", "ha": "center"}
    note(axes, f"l1 {w.l1_mm:.2f} mm, β {turn:.1f}°", (0.5 * reach, 0.5 * (clamp + w.l2_mm)), (0, 8), **arm)
    axes.annotate(
        "traced", (0.62 * reach, 0.5 * low), (0.44 * reach, 0.5 * low), ha="right", va="center",
        arrowprops={"arrowstyle": "->"},
    )  # fmt: skip
    axes.update_datalim([(-0.35 * reach, low), (1.4 * reach, high)])
    axes.set(
        xlabel="mm",
        title=f"{describe_section(w)}, pressed on by {design.preload_mm:.3f} mm; to scale, bent as the exact beam",
    )
    axes.set_aspect("equal", adjustable="datalim")


def _tip_panel(axes: Axes, design: Design) -> None:
    """Draw ball, tip arm and the steepest mark, to scale; the tip stands on the groove's floor."""
    request, radius, depth = design.request, design.request.tip_radius_mm, design.request.depth_mm
    wall, stroke = request.narrowest_wall_mm, request.character_height_mm / 10.0
    floor = max(stroke - 2.0 * wall, 0.0)
    deep = depth if floor > 0.0 else 0.5 * stroke / wall * depth
    half = 0.5 * floor + min(wall, 0.5 * stroke)
    wide, bottom = max(1.6 * stroke, 6.0 * depth), -1.25 * max(design.preload_mm, 2.0 * depth)
    xs, ys = [-wide, -half, -0.5 * floor, 0.5 * floor, half, wide], [0.0, 0.0, -deep, -deep, 0.0, 0.0]
    axes.fill_between(xs, ys, bottom, color=LAND, zorder=0)
    axes.plot(xs, ys, color="0.4", linewidth=1.0)
    _draw_whisker(axes, np.add(_bent_mm(design), (0.0, radius - deep)), design, colour=PALE)
    axes.add_patch(Circle((0.0, radius - deep), radius, color=STEEL, zorder=4))
    axes.axhline(-design.preload_mm, color=VERMILION, linewidth=0.8, linestyle="--")
    axes.text(0.98 * wide, -design.preload_mm, "free path of the tip", color=VERMILION, va="top", ha="right")
    axes.set(
        xlim=(-wide, wide), ylim=(bottom, min(max(1.4 * design.whisker.l2_mm, 4.0 * depth), 2.0 * wide)),
        aspect="equal", title="tip in a stroke of h/10",
        xlabel=f"mm; walls {math.degrees(request.alpha_rad[1]):g}°, ball radius {radius:.3f} mm",
    )  # fmt: skip


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
            0.5 * (low + high), 0.98, "walls asked for", transform=axes.get_xaxis_transform(), ha="center", va="top",
            color="0.4",
        )  # fmt: skip
        at = factors(design.whisker, alpha_rad=np.array([worst.alpha_rad]), mu=np.array([worst.mu]))
        axes.plot(math.degrees(worst.alpha_rad), at[0, 0], "o", color=VERMILION, markersize=5)
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
    found, here = np.isfinite(contrast), allowed == trade.at
    axes.semilogx(allowed[found], contrast[found], "o-", color=STEEL, markersize=4, linewidth=1.4)
    axes.plot(allowed[here], contrast[here], "o", color=VERMILION, markersize=7, label="this design")
    if not found.all():
        axes.plot(allowed[~found], np.zeros(np.sum(~found)), "x", color="0.5", label="no whisker")
    axes.set_xticks(allowed, [f"{a:.3g}" for a in allowed], rotation=45)
    axes.minorticks_off()
    axes.grid()
    axes.set(
        ylim=(0.0, 1.15 * max(contrast[found], default=1.0)), xlabel=f"{trade.name}, {trade.unit}",
        ylabel="worst edge contrast", title=f"contrast against {trade.name}",
    )  # fmt: skip
    axes.legend(loc="lower left")
