"""Pictures of a bench: the path of a dry run from above, and measured and predicted signals over a test piece."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Box
from numpy.typing import NDArray

from pipeline.bench.moves import Moves
from pipeline.bench.settings import BenchSettings
from pipeline.plots.pictures import BLUE, GREEN, PALE, PURPLE, VERMILION, styled
from whisker_array.identification.fit import Identified
from whisker_array.identification.traces import Trace

_COLOURS = {0: BLUE, 90: VERMILION, 180: GREEN, 270: PURPLE}


@styled
def moves_figure(moves: Sequence[Moves], bench: BenchSettings) -> Figure:
    """Draw all moves, within the stage's travel and enlarged."""
    figure = Figure(figsize=(9.0, 4.4), dpi=150)
    whole, near = figure.subplots(1, 2, width_ratios=(1.0, 1.4))
    for axes in (whole, near):
        _from_above(axes, moves, bench)
    (x0, x1), (y0, y1), _ = bench.stage.travel_mm
    whole.set(title="within its travel (dashed)", xlim=(x0 - 5.0, x1 + 5.0), ylim=(y0 - 5.0, y1 + 5.0))
    near.set(title=f"{len(moves)} passes: path of the turning axis")
    figure.legend(*near.get_legend_handles_labels(), loc="outside upper center", ncols=6)
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


@styled
def identified_figure(result: Identified, *, most_lines: int = 4) -> Figure:
    """Draw one line of the recording for each direction, at most `most_lines`, and the histogram of all residuals."""
    pairs = list(zip(result.traces, result.predicted, strict=True))
    by_way: dict[tuple[int, bool], tuple[Trace, NDArray[np.float64]]] = {}
    for pair in pairs:
        by_way.setdefault((int(pair[0].plan.direction), pair[0].plan.pushed), pair)
    shown = list(by_way.items())[:most_lines]
    figure = Figure(figsize=(10.0, 2.2 * (len(shown) + 1)))
    *panels, histogram = figure.subplots(len(shown) + 1, 1)
    for axes, ((degrees, pushed), (trace, predicted)) in zip(panels, shown, strict=True):
        place = trace.plan.position_mm()
        axes.plot(place, trace.measured_n_mm, color=BLUE, linewidth=1.4, label="measured")
        axes.plot(place, predicted, color=VERMILION, linewidth=1.0, linestyle="--", label="predicted")
        axes.plot(place, trace.measured_n_mm - predicted, color="0.33", linewidth=0.8, label="residual")
        axes.axhline(0.0, color="0.8", linewidth=0.6)
        axes.set_title(f"{degrees}°{', pushed' if pushed else ''}, whisker {trace.whisker}")
        axes.set(xlabel="position along the trace, mm", ylabel="signal, N mm")
    panels[0].legend(loc="upper right", ncols=3)
    left = np.concatenate([t.measured_n_mm - p for t, p in pairs])
    left = left[np.isfinite(left)] / result.scatter_n_mm
    histogram.hist(np.clip(left, -8.0, 8.0), bins=120, color="0.33", log=True)
    histogram.set(title="residuals, in standard deviations of a sample", ylabel="samples")
    return figure
