"""What was felt over a test piece, what the bench found predicts, and what is left over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from glyphs.atomic import replacing
from whisker_array.identification.fit import Identified

_SHOWN = 4
_FELT, _PREDICTED, _LEFT = "#0072B2", "#D55E00", "#555555"


def draw_identified(found: Identified, path: Path) -> None:
    """Four lines of the recording, one a direction where there are so many, and all residuals.

    Raises:
        FileError: it cannot be written.
    """
    by_way: dict[tuple[int, bool], int] = {}
    for k, trace in enumerate(found.traces):
        by_way.setdefault((int(trace.plan.direction), trace.plan.pushed), k)
    shown = list(by_way.values())[:_SHOWN]
    figure = Figure(figsize=(10.0, 2.2 * (len(shown) + 1)), dpi=110, layout="constrained")
    panels = figure.subplots(len(shown) + 1, 1)
    for axes, k in zip(panels, shown, strict=False):
        trace, predicted = found.traces[k], found.predicted[k]
        place = trace.plan.position_mm()
        axes.plot(place, trace.felt_n_mm, color=_FELT, linewidth=1.4, label="felt")
        axes.plot(place, predicted, color=_PREDICTED, linewidth=1.0, linestyle="--", label="predicted")
        axes.plot(place, trace.felt_n_mm - predicted, color=_LEFT, linewidth=0.8, label="left over")
        axes.axhline(0.0, color="#cccccc", linewidth=0.6)
        way = f"{int(trace.plan.direction)}°{', pushed' if trace.plan.pushed else ''}"
        axes.set_title(f"{way}, whisker {trace.whisker}", fontsize=10, loc="left")
        axes.set_xlabel("place along the trace, mm")
        axes.set_ylabel("signal, N mm")
    panels[0].legend(loc="upper right", fontsize=8, ncols=3)
    left = np.concatenate([t.felt_n_mm - p for t, p in zip(found.traces, found.predicted, strict=True)])
    left = left[np.isfinite(left)] / found.scatter_n_mm
    panels[-1].hist(np.clip(left, -8.0, 8.0), bins=120, color=_LEFT, log=True)
    panels[-1].set_title("left over, in standard deviations of a sample", fontsize=10, loc="left")
    panels[-1].set_ylabel("samples")
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:] or "svg")
