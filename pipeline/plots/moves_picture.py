"""A dry run: the stage's way from above, and the height of the tips."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Box

from pipeline.bench.moves import Moves
from pipeline.bench.settings import BenchSettings
from pipeline.plots.pictures import BLUE, GREEN, PALE, PURPLE, VERMILION, styled

_COLOURS = {0: BLUE, 90: VERMILION, 180: GREEN, 270: PURPLE}


@styled
def moves_figure(moves: Sequence[Moves], bench: BenchSettings, *, profiled: int = 3) -> Figure:
    """Draw all moves within the stage's travel; below, the height of the tips over the first `profiled` passes."""
    figure = Figure(figsize=(9.0, 6.4), dpi=150)
    grid = figure.add_gridspec(2, 2, height_ratios=(2.6, 1.0), width_ratios=(1.0, 1.4))
    whole, near = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    for axes in (whole, near):
        _from_above(axes, moves, bench)
    (x0, x1), (y0, y1), _ = bench.stage.travel_mm
    whole.set(title="within its travel (dashed)", xlim=(x0 - 5.0, x1 + 5.0), ylim=(y0 - 5.0, y1 + 5.0))
    near.set(title=f"{len(moves)} passes: way of the turning axis")
    figure.legend(*near.get_legend_handles_labels(), loc="outside upper center", ncols=6)
    _height(figure.add_subplot(grid[1, :]), moves[:profiled], bench)
    return figure


def _from_above(axes: Axes, moves: Sequence[Moves], bench: BenchSettings) -> None:
    stage, ((x0, x1), (y0, y1), _) = bench.stage, bench.stage.travel_mm
    axes.add_artist(Box((x0, y0), x1 - x0, y1 - y0, fill=False, ls="--", color="0.4"))
    flips = np.array([-1.0 if flip else 1.0 for flip in (stage.flip_x, stage.flip_y)])
    corners = np.reshape(bench.plate.field_mm, (2, 2)) * flips + stage.origin_mm
    axes.add_patch(Box(tuple(corners.min(axis=0)), *np.ptp(corners, axis=0), color="#eef2f6", label="field"))
    ends = np.array([[m.begin_mm, m.end_mm] for m in moves])
    lifted = np.stack([ends[:-1, 1], ends[1:, 0]], axis=1)
    axes.plot(*lifted.transpose(2, 1, 0), color=PALE, linewidth=0.5, linestyle=":")
    axes.plot([], [], color=PALE, linestyle=":", label="lifted")
    for turn, colour in _COLOURS.items():
        some = ends[[round(m.turn_deg) % 360 == turn for m in moves]]
        if some.size:
            axes.plot(*some.transpose(2, 1, 0), color=colour, linewidth=0.8)
            axes.plot(*some[:, 0].T, "o", markersize=2.5, color=colour, label=f"{turn}°, from its dot")
    axes.set(aspect="equal", xlabel="machine x, mm", ylabel="machine y, mm")


def _height(axes: Axes, moves: Sequence[Moves], bench: BenchSettings) -> None:
    stage, took_s, z_mm = bench.stage, [0.0], [bench.stage.land_z_mm + bench.stage.lift_mm]
    for one in moves:
        way_mm = one.lift_z_mm - one.touch_z_mm
        took_s += [one.air_s, way_mm / stage.lower_mm_s, one.ramp.duration_s, way_mm / stage.rapid_mm_s]
        z_mm += [one.lift_z_mm, one.touch_z_mm, one.touch_z_mm, one.lift_z_mm]
    axes.axhline(stage.land_z_mm, color="0.4", linewidth=0.8, linestyle="--", label="land")
    axes.plot(np.cumsum(took_s), z_mm, color=BLUE, linewidth=1.2, label="tips without load")
    axes.set(
        xlabel=f"s, of the first {len(moves)} passes without the way between them", ylabel="machine z, mm"
    )
    axes.legend(loc="center right")
