"""The picture of one part, for people: all that was measured and read of it, mm, row 0 at the top.

+---------------------+---------------------+
| photograph, boxes   | height map, boxes   |
+---------------------+---------------------+
| height by touch     | moments             |
+---------------------+---------------------+
| steepness by touch  | edge map, a picture |
+---------------------+ a trace direction   |
| ...                   the last one wide   |
+-------------------------------------------+
| candidates of every place                 |
+-------------------------------------------+
  what to know about the reading

Of a part that is less than twice as wide as high four panels stand in a row.

Only what there is has a panel. Of a scan there is no height map; its moments come last.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from recognition.decision.panels import (
    BOX_COLOUR,
    candidate_panel,
    edge_panel,
    height_panel,
    moment_panel,
    photo_panel,
    relief_panel,
    steepness_panel,
)
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.scan.scan import only

if TYPE_CHECKING:
    from collections.abc import Callable

    from glyphs.camera.photo import Photo
    from recognition import Reading, ReadingTrace


def reading_figure(reading: Reading, *, title: str = "", figure: Figure | None = None) -> Figure:
    """All that is known of one part, drawn on a figure of its own unless one is given."""
    photo, touch = reading.trace.photo, reading.touch
    panels: list[Callable[[Axes], None]] = []
    if photo is not None:
        panels.append(partial(photo_panel, photo=photo, reading=_shown_on(photo, reading)))
    if touch is not None:
        panels += _touch_panels(touch.trace, reading)
    columns = 2 if _is_long(reading) else 4
    rows = -(-len(panels) // columns)
    figure = figure if figure is not None else Figure(dpi=110)
    figure.set_size_inches(12.0, 3.5 + 2.1 * rows)
    figure.set_layout_engine("constrained")
    figure.suptitle(
        f"{title}: {reading}" if title else str(reading), fontsize=12, fontweight="bold", wrap=True
    )
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[1.0] * rows + [1.05])
    for k, draw in enumerate(panels):
        row, column = divmod(k, columns)
        alone = k == len(panels) - 1 and column == 0
        draw(figure.add_subplot(grid[row, :] if alone else grid[row, column]))
    candidate_panel(figure.add_subplot(grid[rows, :]), reading)
    if reading.characters and reading.messages():
        figure.supxlabel(
            "\n".join(reading.messages()), fontsize=9.5, color=BOX_COLOUR, x=0.01, ha="left", parse_math=False
        )
    return figure


def _is_long(reading: Reading) -> bool:
    """Whether the part is at least twice as wide as high: two panels fill a row, of others four."""
    photo, edges = reading.trace.photo, None if reading.touch is None else reading.touch.trace.edge_map
    if edges is not None:
        rows, columns = edges.valid.shape
    elif photo is not None:
        rows, columns = photo.shape
    else:
        return True
    return bool(columns >= 2 * rows)


def _shown_on(photo: Photo, reading: Reading) -> Reading | None:
    """The reading whose boxes lie in the photograph's frame, if one's do."""
    if reading.vision is not None:
        return reading.vision
    return reading if photo.centre_mm is not None else None


def _touch_panels(touch: ReadingTrace, reading: Reading) -> list[Callable[[Axes], None]]:
    """Return the panels of touch: heights first, then moments, steepness and edges."""
    edges, scan, surface, relief = touch.edge_map, touch.scan, touch.height_map, touch.relief
    heights, slopes, layers, moments = (list[Any]() for _ in range(4))
    if surface is not None:
        heights.append(partial(height_panel, height_map=surface, reading=reading))
    if relief is not None:
        heights.append(partial(relief_panel, relief=relief, reading=reading, labelled=surface is None))
        if relief.slope_x is not None or relief.slope_y is not None:
            # slower than the reader needs, walls truer
            steep = relief if scan is None or edges is None else estimate_relief(scan, edges)
            slopes.append(partial(steepness_panel, relief=steep, reading=reading))
    if scan is not None:
        moments.append(partial(moment_panel, sweep=only(scan).sweeps[0]))
    if edges is not None:
        layers = [
            partial(edge_panel, edges=edges, layer=k, reading=reading) for k in range(len(edges.directions))
        ]
    if surface is None:
        return [*heights, *slopes, *layers, *moments]
    return [*heights, *moments, *slopes, *layers]
