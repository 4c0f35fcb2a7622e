"""A design as a picture: the whisker and its tip to scale, F over the wall's inclination, the trade-offs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon
from numpy.typing import NDArray

from pipeline.common.section_words import describe_section
from whisker_array.design.design import Design
from whisker_array.design.trade import TradeOff
from whisker_array.design.tuned import Tuned, factors, middle_friction
from whisker_array.whisker.elastica import ElasticaError, large_deflection
from whisker_array.whisker.shapes import LShaped

_STEEL, _PALE, _MARK, _LAND, _AXIS = "#3b5b7a", "#a5b5c7", "#c2571a", "#d9d4c7", "#2f7d4f"
_CURVES = ("#9ec5e8", "#4a86c5", "#173f6b")


def design_figure(design: Design, *, trades: Sequence[TradeOff] = (), tuned: Tuned | None = None) -> Figure:
    """Whisker, tip and mark, F, and up to two trade-offs."""
    figure = Figure(figsize=(13.0, 7.6), dpi=110, layout="constrained")
    grid = figure.add_gridspec(2, 6, height_ratios=(1.0, 1.0))
    _whisker_panel(figure.add_subplot(grid[0, :4]), design)
    _tip_panel(figure.add_subplot(grid[0, 4:]), design)
    width = 6 // (1 + len(trades))
    _factor_panel(figure.add_subplot(grid[1, :width]), design, tuned)
    for k, trade in enumerate(trades, start=1):
        _trade_panel(figure.add_subplot(grid[1, k * width : (k + 1) * width]), trade)
    return figure


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=9, loc="left")
    axes.tick_params(labelsize=7)


def _bent(design: Design) -> NDArray[np.float64]:
    """(n, 2) the whisker pressed on the land at middle friction, tip at the origin; unbent if need be."""
    w = design.whisker
    try:
        line = large_deflection(w, lift_mm=design.preload_mm, mu=middle_friction(design.request.mu)).shape_mm
    except ElasticaError:
        ends = [s.end_mm[:2] for s in w.segments()]
        line = np.array([[0.0, 0.0], *ends])
    return np.asarray(line - line[-1])


def _arms(line: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The line cut at its elbow, the sharpest turn: l1 from the clamp, and the tip arm."""
    ahead = np.diff(line, axis=0)
    ahead = ahead[keep := np.hypot(*ahead.T) > 0.0]
    points = np.concatenate([line[:1], line[1:][keep]])
    turn = np.abs(ahead[:-1, 0] * ahead[1:, 1] - ahead[:-1, 1] * ahead[1:, 0])
    turn /= np.hypot(*ahead[:-1].T) * np.hypot(*ahead[1:].T)
    elbow = int(np.argmax(turn)) + 1
    return points[: elbow + 1], points[elbow:]


def _band(line: NDArray[np.float64], half_mm: float, end_mm: float) -> NDArray[np.float64]:
    """The outline of a line that is so thick, and so thick at its end."""
    ahead = np.gradient(line, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.linspace(half_mm, end_mm, len(line))[:, None] * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    return np.concatenate([line + side, (line - side)[::-1]])


def _draw(axes: Axes, line: NDArray[np.float64], design: Design, *, colour: str = _STEEL) -> None:
    """l1 and the tip arm, which is ground down to its ball."""
    half, r = 0.5 * _thickness_mm(design.whisker), design.tip_radius_mm
    for part, end in zip(_arms(line), (half, min(r, half)), strict=True):
        axes.add_patch(Polygon(_band(part, half, end), closed=True, color=colour, lw=0.0, zorder=3))
    x, y = _arms(line)[1][0]
    axes.add_patch(Circle((float(x), float(y)), half, color=colour, lw=0.0))


def _thickness_mm(w: LShaped) -> float:
    return 2.0 * w.segments()[0].section_at(0.0).c_vertical_mm


def _span(
    axes: Axes, a: tuple[float, float], b: tuple[float, float], text: str, *, side: float = 1.0
) -> None:
    """A dimension line from a to b with its text beside."""
    axes.annotate(
        "", a, b, arrowprops={"arrowstyle": "<->", "color": "0.3", "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    )
    slope = math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))
    axes.annotate(
        text,
        (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])),
        xytext=(-7.0 * side * math.sin(math.radians(slope)), 7.0 * side * math.cos(math.radians(slope))),
        textcoords="offset points",
        rotation=slope,
        rotation_mode="anchor",
        ha="center",
        va="center",
        fontsize=8,
    )


def _whisker_panel(axes: Axes, design: Design) -> None:
    w, line = design.whisker, _bent(design)
    clamp = line[0]
    reach = float(clamp[0])
    axis = (reach, float(clamp[1]) - w.lowered_mm)
    low, high = min(0.0, axis[1]), max(float(clamp[1]), axis[1])
    margin = 0.12 * reach
    axes.axhspan(low - margin, 0.0, color=_LAND, zorder=0)
    _draw(axes, line, design)
    block = 0.06 * reach
    axes.add_patch(
        Polygon(
            [(reach, clamp[1] - block), (reach + 0.6 * block, clamp[1] - block),
             (reach + 0.6 * block, clamp[1] + block), (reach, clamp[1] + block)],
            closed=True, facecolor="0.75", edgecolor="0.3", hatch="////", zorder=2,
        )
    )  # fmt: skip
    axes.plot([reach + 0.3 * block] * 2, [clamp[1], axis[1]], color=_AXIS, lw=1.2, ls="--", zorder=1)
    axes.plot(*axis, marker="+", ms=11, mew=2.0, color=_AXIS, zorder=4, clip_on=False)
    axes.annotate(
        "sensor axis", axis, xytext=(-8, 8), textcoords="offset points", fontsize=8, color=_AXIS, ha="right"
    )
    elbow = np.array([reach - w.l1_mm * math.cos(w.beta_rad), clamp[1] - w.l1_mm * math.sin(w.beta_rad)])
    away = 0.07 * reach * np.array([-math.sin(w.beta_rad), math.cos(w.beta_rad)])
    a, b = elbow + away, clamp + away
    _span(axes, (float(a[0]), float(a[1])), (float(b[0]), float(b[1])), f"l1 {w.l1_mm:.2f} mm")
    if abs(w.lowered_mm) > 0.02 * reach:
        right = reach + 2.2 * block
        ends = sorted((axis[1], float(clamp[1])))
        _span(axes, (right, ends[0]), (right, ends[1]), f"l3 {w.lowered_mm:.2f} mm", side=-1.0)
    if w.beta_rad > math.radians(3.0):
        at = 0.35 * reach
        # from the level through the elbow
        axes.plot([elbow[0], elbow[0] + 1.15 * at], [elbow[1]] * 2, color="0.5", lw=0.7, ls=":")
        axes.add_patch(
            Arc((elbow[0], elbow[1]), 2 * at, 2 * at, theta1=0, theta2=math.degrees(w.beta_rad), color="0.3")
        )
        axes.annotate(
            f"β {math.degrees(w.beta_rad):.1f}°",
            (elbow[0] + at * math.cos(0.5 * w.beta_rad), elbow[1] + at * math.sin(0.5 * w.beta_rad)),
            xytext=(4, 0), textcoords="offset points", fontsize=8, va="center",
        )  # fmt: skip
    axes.annotate(f"l2 {w.l2_mm:.2f} mm", (0.0, 0.5 * w.l2_mm), xytext=(-6, 3), textcoords="offset points",
                  fontsize=8, ha="right", va="bottom")  # fmt: skip
    axes.annotate("", (0.62 * reach, 0.5 * (low - margin)), (0.45 * reach, 0.5 * (low - margin)),
                  arrowprops={"arrowstyle": "->"})  # fmt: skip
    axes.text(0.44 * reach, 0.5 * (low - margin), "traced", fontsize=8, ha="right", va="center")
    axes.set_xlim(-0.35 * reach, reach + 6.0 * block)
    axes.set_ylim(low - margin, high + 1.6 * margin)
    axes.set_aspect("equal")
    axes.set_xlabel("mm", fontsize=7)
    _title(
        axes,
        f"{describe_section(w)}, pressed on by {design.preload_mm:.3f} mm; to scale, bent as the exact beam",
    )


def _tip_panel(axes: Axes, design: Design) -> None:
    """Ball, tip arm and the steepest mark, to scale; the tip stands on the groove's floor."""
    r, depth = design.tip_radius_mm, design.request.depth_mm
    wall = design.request.narrowest_wall_mm
    stroke = design.request.character_height_mm / 10.0
    floor = max(stroke - 2.0 * wall, 0.0)
    deep = depth if floor > 0.0 else 0.5 * stroke / wall * depth
    half = 0.5 * floor + min(wall, 0.5 * stroke)
    wide = max(1.6 * stroke, 6.0 * depth)
    bottom = -1.25 * max(design.preload_mm, 2.0 * depth)
    xs = [-wide, -half, -0.5 * floor, 0.5 * floor, half, wide]
    ys = [0.0, 0.0, -deep, -deep, 0.0, 0.0]
    axes.fill_between(xs, ys, bottom, color=_LAND, zorder=0)
    axes.plot(xs, ys, color="0.4", lw=1.0)
    line = _bent(design) + np.array([0.0, r - deep])
    _draw(axes, line, design, colour=_PALE)
    axes.add_patch(Circle((0.0, r - deep), r, color=_STEEL, zorder=4))
    axes.axhline(-design.preload_mm, color=_MARK, lw=0.8, ls="--")
    axes.text(
        0.98 * wide, -design.preload_mm, "free path of the tip", fontsize=7, color=_MARK, va="top", ha="right"
    )
    axes.set_xlim(-wide, wide)
    axes.set_ylim(bottom, min(max(1.4 * design.whisker.l2_mm, 4.0 * depth), 2.0 * wide))
    axes.set_aspect("equal")
    steepest = math.degrees(design.request.alpha_rad[1])
    axes.set_xlabel(f"mm; walls {steepest:g}°, ball radius {r:.3f} mm", fontsize=7)
    _title(axes, "tip in a stroke of h/10")


def _factor_panel(axes: Axes, design: Design, tuned: Tuned | None) -> None:
    r = design.request
    mus = (r.mu[0], middle_friction(r.mu), r.mu[1])
    steepest = r.alpha_rad[1]
    ends = (-steepest, steepest) if tuned is None else (0.0, math.radians(70.0))
    alpha = np.linspace(*ends, 241)
    values = factors(design.whisker, alpha_rad=alpha, mu=np.array(mus))
    for k, mu in enumerate(mus):
        axes.plot(np.degrees(alpha), values[:, k], color=_CURVES[k], lw=1.6, label=f"µ = {mu:.2g}")
    axes.axhline(1.0, color="0.6", lw=0.7)
    if tuned is None:
        low, high = (math.degrees(a) for a in r.alpha_rad)
        for a, b in ((low, high), (-high, -low)):
            axes.axvspan(a, b, color="0.93", zorder=0)
        axes.annotate("walls asked for", (0.5 * (low + high), 0.98), xycoords=("data", "axes fraction"),
                      fontsize=7, ha="center", va="top", color="0.4")  # fmt: skip
        at, mu_at = np.array([design.worst.alpha_rad]), np.array([design.worst.mu])
        axes.plot(
            np.degrees(at), factors(design.whisker, alpha_rad=at, mu=mu_at)[:, 0], "o", color=_MARK, ms=5
        )
        _title(axes, f"F over the wall (dot: worst, contrast {design.contrast:.3f})")
    else:
        place = math.degrees(tuned.alpha_rad)
        axes.axvline(place, color=_MARK, lw=1.0)
        axes.axvspan(place - 10.0, place + 10.0, color="0.93", zorder=0)
        axes.axhline(0.0, color="0.6", lw=0.7)
        finite = values[np.isfinite(values)]
        axes.set_ylim(max(float(finite.min()), -3.0) - 0.1, min(float(finite.max()), 6.0) + 0.1)
        _title(axes, f"F over the wall: {tuned.kind.value} at {place:g}°, shaded ±10°")
    axes.set_xlabel("α, degrees; falling walls positive", fontsize=7)
    axes.set_ylabel("F = moment on the wall / on the land", fontsize=7)
    axes.legend(
        fontsize=7,
        frameon=False,
        loc="upper left" if tuned is None or float(np.nanmax(values)) > 1.5 else "lower left",
    )


def _trade_panel(axes: Axes, trade: TradeOff) -> None:
    pairs = [(a, c) for a, c in zip(trade.allowed, trade.contrast, strict=True) if c is not None]
    axes.plot([a for a, _ in pairs], [c for _, c in pairs], "o-", color=_STEEL, ms=4, lw=1.4)
    here = [(a, c) for a, c in pairs if a == trade.at]
    axes.plot([a for a, _ in here], [c for _, c in here], "o", color=_MARK, ms=7, label="this design")
    none = [a for a, c in zip(trade.allowed, trade.contrast, strict=True) if c is None]
    if none:
        axes.plot(none, [0.0] * len(none), "x", color="0.5", ms=6, label="no whisker")
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.15 * max([c for _, c in pairs], default=1.0))
    axes.set_xticks(list(trade.allowed), [f"{a:.3g}" for a in trade.allowed], rotation=45)
    axes.minorticks_off()
    axes.set_xlabel(f"{trade.name}, {trade.unit}", fontsize=7)
    axes.set_ylabel("worst edge contrast", fontsize=7)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, frameon=False, loc="lower left")
    _title(axes, f"contrast against {trade.name}")
