"""Signals felt over a test piece, those that the identified bench predicts, and the residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.plots.pictures import BLUE, VERMILION, styled
from whisker_array.identification.fit import Identified
from whisker_array.identification.traces import Trace


@styled
def identified_figure(found: Identified, *, most_lines: int = 4) -> Figure:
    """Draw a line of the recording for each direction, up to `most_lines`, and the histogram of all residuals."""
    pairs = list(zip(found.traces, found.predicted, strict=True))
    by_way: dict[tuple[int, bool], tuple[Trace, NDArray[np.float64]]] = {}
    for pair in pairs:
        by_way.setdefault((int(pair[0].plan.direction), pair[0].plan.pushed), pair)
    shown = list(by_way.items())[:most_lines]
    figure = Figure(figsize=(10.0, 2.2 * (len(shown) + 1)))
    *panels, histogram = figure.subplots(len(shown) + 1, 1)
    for axes, ((degrees, pushed), (trace, predicted)) in zip(panels, shown, strict=True):
        place = trace.plan.position_mm()
        axes.plot(place, trace.felt_n_mm, color=BLUE, linewidth=1.4, label="felt")
        axes.plot(place, predicted, color=VERMILION, linewidth=1.0, linestyle="--", label="predicted")
        axes.plot(place, trace.felt_n_mm - predicted, color="0.33", linewidth=0.8, label="residual")
        axes.axhline(0.0, color="0.8", linewidth=0.6)
        axes.set_title(f"{degrees}°{', pushed' if pushed else ''}, whisker {trace.whisker}")
        axes.set(xlabel="place along the trace, mm", ylabel="signal, N mm")
    panels[0].legend(loc="upper right", ncols=3)
    left = np.concatenate([t.felt_n_mm - p for t, p in pairs])
    left = left[np.isfinite(left)] / found.scatter_n_mm
    histogram.hist(np.clip(left, -8.0, 8.0), bins=120, color="0.33", log=True)
    histogram.set(title="residuals, in standard deviations of a sample", ylabel="samples")
    return figure
