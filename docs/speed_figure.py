"""The dynamic whisker over stamped grooves: its traces, and its errors against speed beside those of the small model.

`python -m docs.speed_figure` prints the table of `docs/pages/physics.md`, and that of `docs/pages/results-whisker.md`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.pictures import BLUE, GREEN, PURPLE, VERMILION, note, styled
from tests.benchmarks.whisker_study import BY_CORRELATION
from tests.proof.dynamic import FINE_ERROR, SpeedCost, speed_cost
from tests.proof.small_model import SpeedErrors, speed_errors
from whisker_array.whisker.array import SAFE_SPEED_MM_S
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

HEIGHT_MM = 5.0
BEVELS_DEG = {30.0: BLUE, 45.0: VERMILION, 60.0: GREEN}
SPEEDS_MM_S = (5.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 140.0, 200.0, 300.0, 500.0)
TRACED_MM_S = {10.0: BLUE, 50.0: VERMILION, 100.0: GREEN, 200.0: PURPLE}
_LEAST_MM = 1e-3


def errors_by_speed(speeds_mm_s: tuple[float, ...]) -> dict[float, list[SpeedErrors]]:
    """Errors of the default whisker for characters of 5 mm, by the bevel of the walls."""
    whisker, touch = default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM)
    return {
        bevel: [
            speed_errors(whisker, touch, speed_mm_s=speed, height_mm=HEIGHT_MM, bevel_rad=math.radians(bevel))
            for speed in speeds_mm_s
        ]
        for bevel in BEVELS_DEG
    }


@styled
def speed_figure() -> Figure:
    """Draw the default whisker for characters of 5 mm, at the friction that it is set up for."""
    whisker, touch = default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM)
    figure = Figure(figsize=(8.4, 9.4))
    figure.suptitle("What speed costs: the default whisker over a stamped groove, 5 mm characters")
    panels = figure.subplot_mosaic(
        [["traces"] * 2, ["error"] * 2, ["ringing", "air"]], height_ratios=(1.3, 1.0, 1.0)
    )
    traces = panels["traces"]
    for k, (speed, colour) in enumerate(TRACED_MM_S.items()):
        cost = speed_cost(whisker, touch, speed_mm_s=speed, character_height_mm=HEIGHT_MM)
        traces.plot(cost.place_mm, cost.fast - 0.5 * k, color=colour, linewidth=1.0)
        traces.plot(cost.place_mm, cost.slow - 0.5 * k, color="0.4", linewidth=0.7, linestyle="--")
        note(traces, f"{speed:g} mm/s", (cost.place_mm[-1], 1.0 - 0.5 * k), (-2, 5), ha="right", color=colour)
    traces.set(
        xlabel="along the trace, mm; walls of 45°",
        ylabel="moment / land's, each 0.5 lower",
        title="dashed: slow stage",
    )
    costs = {
        bevel: [
            speed_cost(
                whisker, touch, speed_mm_s=speed, character_height_mm=HEIGHT_MM, bevel_rad=math.radians(bevel)
            )
            for speed in SPEEDS_MM_S
        ]
        for bevel in BEVELS_DEG
    }
    error = panels["error"]
    for bevel, errors in errors_by_speed(SPEEDS_MM_S).items():
        colour = BEVELS_DEG[bevel]
        with_mass, model = [100.0 * e.with_mass for e in errors], [100.0 * e.model for e in errors]
        error.loglog(
            SPEEDS_MM_S, with_mass, "o-", markersize=3, linewidth=1.2, color=colour, label=f"{bevel:g}°"
        )
        error.loglog(SPEEDS_MM_S, model, "--", linewidth=1.0, color=colour)
    _dress(error, "error of the edge map, % of the signal; dashed: small model")
    _panel(panels["ringing"], "ringing behind, % of the land's", costs, lambda cost: 100.0 * cost.ringing)
    _panel(
        panels["air"], "not touched, mm (0: at the foot)", costs, lambda cost: max(cost.in_air_mm, _LEAST_MM)
    )
    error.axhline(100.0 * FINE_ERROR, color="0.5", linewidth=0.8, linestyle="--")
    error.axvline(SAFE_SPEED_MM_S, color="0.5", linewidth=0.8, linestyle=":")
    error.text(1.02 * SAFE_SPEED_MM_S, 0.03, "usual speed", transform=error.get_xaxis_transform())
    return figure


def _panel(
    axes: Axes, title: str, costs: dict[float, list[SpeedCost]], value: Callable[[SpeedCost], float]
) -> None:
    for bevel, one in costs.items():
        line = [value(cost) for cost in one]
        axes.loglog(
            SPEEDS_MM_S, line, "o-", markersize=3, linewidth=1.2, color=BEVELS_DEG[bevel], label=f"{bevel:g}°"
        )
    _dress(axes, title)


def _dress(axes: Axes, title: str) -> None:
    ticks = (5, 10, 20, 50, 100, 200, 500)
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.grid()
    axes.set(xlabel="mm/s", title=title)
    axes.legend(title="walls")


def table(speeds_mm_s: tuple[float, ...] = (20.0, 35.0, 50.0, 70.0, 100.0, 140.0)) -> str:
    """Errors of the edge map in Markdown, percent of the signal: with mass, and of the small model."""
    head = ("walls", *(f"{speed:g} mm/s" for speed in speeds_mm_s))
    return _rows(head, ((f"{bevel:g}°", errors) for bevel, errors in errors_by_speed(speeds_mm_s).items()))


def whisker_table(speed_mm_s: float = SAFE_SPEED_MM_S) -> str:
    """The same for the whiskers of the study, by the bevel of the walls."""
    usual, rows = default_touch(HEIGHT_MM), []
    for cell in BY_CORRELATION:
        whisker = cell.whisker(HEIGHT_MM)
        errors = [
            speed_errors(
                whisker, usual.with_whisker(whisker), speed_mm_s=speed_mm_s, height_mm=HEIGHT_MM,
                bevel_rad=math.radians(bevel),
            )
            for bevel in BEVELS_DEG
        ]  # fmt: skip
        rows.append((cell.name, errors))
    return _rows(("cell", *(f"walls of {bevel:g}°" for bevel in BEVELS_DEG)), rows)


def _rows(head: Sequence[str], errors: Iterable[tuple[str, Sequence[SpeedErrors]]]) -> str:
    rows = [head, ["---"] * len(head)]
    rows += [
        [name, *(f"{100.0 * e.with_mass:.1f}; {100.0 * e.model:.1f}" for e in line)] for name, line in errors
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


if __name__ == "__main__":
    print(table(), whisker_table(), sep="\n\n")
