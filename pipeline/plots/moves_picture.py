"""What a dry run shows: where the stage would go from above, and how high the tips would be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Box

from pipeline.bench.moves import Moves
from pipeline.bench.settings import BenchSettings

_COLOURS = {0: "#0072B2", 90: "#D55E00", 180: "#009E73", 270: "#CC79A7"}
"""Of Okabe and Ito, apart for every eye."""
_PALE = "#a5b5c7"
_PROFILED = 3


def moves_figure(moves: Sequence[Moves], bench: BenchSettings) -> Figure:
    """All moves within the stage's travel; below, the height of the tips over the first passes."""
    figure = Figure(figsize=(9.0, 6.4), dpi=150, layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(2.6, 1.0), width_ratios=(1.0, 1.4))
    whole, near = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    for axes in (whole, near):
        _from_above(axes, moves, bench)
    (x0, x1), (y0, y1), _ = bench.stage.travel_mm
    whole.set(title="within its travel (dashed)", xlim=(x0 - 5.0, x1 + 5.0), ylim=(y0 - 5.0, y1 + 5.0))
    near.set(title=f"{len(moves)} passes: way of the turning axis")
    figure.legend(*near.get_legend_handles_labels(), fontsize=8, loc="outside upper center", ncols=6)
    _height(figure.add_subplot(grid[1, :]), moves[:_PROFILED], bench)
    return figure


def _from_above(axes: Axes, moves: Sequence[Moves], bench: BenchSettings) -> None:
    stage, ((x0, x1), (y0, y1), _) = bench.stage, bench.stage.travel_mm
    axes.add_artist(Box((x0, y0), x1 - x0, y1 - y0, fill=False, ls="--", color="0.4"))
    left, top, right, bottom = bench.plate.field_mm
    xs = [stage.origin_mm[0] + v * (-1.0 if stage.flip_x else 1.0) for v in (left, right)]
    ys = [stage.origin_mm[1] + v * (-1.0 if stage.flip_y else 1.0) for v in (top, bottom)]
    axes.add_patch(
        Box((min(xs), min(ys)), abs(xs[1] - xs[0]), abs(ys[1] - ys[0]), color="#eef2f6", label="field")
    )
    ends = np.array([[m.begin_mm, m.end_mm] for m in moves])
    lifted = np.stack([ends[:-1, 1], ends[1:, 0]], axis=1)
    axes.plot(*lifted.transpose(2, 1, 0), color=_PALE, lw=0.5, ls=":")
    axes.plot([], [], color=_PALE, ls=":", label="lifted")
    for turn, colour in _COLOURS.items():
        some = ends[[round(m.turn_deg) % 360 == turn for m in moves]]
        if some.size:
            axes.plot(*some.transpose(2, 1, 0), color=colour, lw=0.8)
            axes.plot(some[:, 0, 0], some[:, 0, 1], "o", ms=2.5, color=colour, label=f"{turn}°, from its dot")
    axes.set(aspect="equal", xlabel="machine x, mm", ylabel="machine y, mm")


def _height(axes: Axes, moves: Sequence[Moves], bench: BenchSettings) -> None:
    stage, now, time_s, z_mm = bench.stage, 0.0, [0.0], [bench.stage.land_z_mm + bench.stage.lift_mm]
    for one in moves:
        down = (one.lift_z_mm - one.touch_z_mm) / stage.lower_mm_s
        up = (one.lift_z_mm - one.touch_z_mm) / stage.rapid_mm_s
        took_s = (one.air_s, down, one.ramp.duration_s, up)
        for took, z in zip(
            took_s, (one.lift_z_mm, one.touch_z_mm, one.touch_z_mm, one.lift_z_mm), strict=True
        ):
            now += took
            time_s.append(now)
            z_mm.append(z)
    axes.axhline(stage.land_z_mm, color="0.4", lw=0.8, ls="--", label="land")
    axes.plot(time_s, z_mm, color=_COLOURS[0], lw=1.2, label="tips without load")
    axes.set(
        xlabel=f"s, of the first {len(moves)} passes without the way between them", ylabel="machine z, mm"
    )
    axes.legend(fontsize=7, loc="center right")
