"""The picture of one part by all senses asked: photograph and the camera's edges above what was felt.

+---------------------+---------------------+
| photograph, boxes   | the camera's edges  |
+---------------------+---------------------+
| as `pipeline.plots.pictures.inspect_figure`     |
+-------------------------------------------+
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.plots.axes import (
    BOX_COLOUR,
    candidate_panel,
    edge_panel,
    height_panel,
    moment_panel,
    photo_panel,
    relief_panel,
    steepness_panel,
    vision_edge_panel,
)
from pipeline.plots.pictures import headline, inspect_figure

if TYPE_CHECKING:
    from collections.abc import Callable

    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import EdgeMap
    from recognition.reading import Reading, ReadingTrace


def inspection_figure(reading: Reading, *, title: str) -> Figure:
    """All that is known of one part."""
    photo, touch = reading.trace.photo, reading.touch
    if photo is None and touch is not None:
        return inspect_figure(reading, title=title)
    panels: list[Callable[[Axes], None]] = []
    if photo is not None:
        panels.append(partial(photo_panel, photo=photo, reading=_shown_on(photo, reading)))
        panels.append(partial(vision_edge_panel, photo=photo, edges=_camera_edges(photo, reading)))
    if touch is not None:
        panels += _touch_panels(touch.trace, reading)
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(12.0, 3.5 + 2.1 * rows), dpi=110, layout="constrained")
    figure.suptitle(f"{title}: {headline(reading)}", fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.15] + [1.0] * (rows - 1) + [1.05])
    for k, draw in enumerate(panels):
        draw(figure.add_subplot(grid[k // 2, k % 2]))
    candidate_panel(figure.add_subplot(grid[rows, :]), reading)
    if reading.characters and reading.messages():
        figure.supxlabel(
            "\n".join(reading.messages()), fontsize=9.5, color=BOX_COLOUR, x=0.01, ha="left", parse_math=False
        )
    return figure


def _shown_on(photo: Photo, reading: Reading) -> Reading | None:
    """The reading whose boxes lie in the photograph's frame, if one's do."""
    if reading.vision is not None:
        return reading.vision
    return reading if photo.centre_mm is not None else None


def _camera_edges(photo: Photo, reading: Reading) -> EdgeMap | None:
    """At the scale of the characters seen, or felt; strong edges as they are, which a person sees more by."""
    from recognition.vision_edges import vision_edges
    from recognition.vision_frame import photo_pitch_mm

    if reading.vision is not None:
        height_mm = reading.vision.height_mm
    else:
        height_mm = reading.height_mm if photo.pitch_mm is not None else 0.0
    if not height_mm >= 8.0 * photo_pitch_mm(photo):
        return None
    return vision_edges(photo, height_mm=height_mm, even=False)


def _touch_panels(touch: ReadingTrace, reading: Reading) -> list[Callable[[Axes], None]]:
    """What was felt: heights first, if there are any, then moments and edges."""
    relief = partial(relief_panel, trace=touch, reading=reading)
    steepness = partial(steepness_panel, trace=touch, reading=reading)
    moment = partial(moment_panel, trace=touch, reading=reading)
    edges, layers = touch.edge_map, list[Any]()
    if edges is not None:
        layers = [
            partial(edge_panel, edges=edges, layer=k, reading=reading) for k in range(len(edges.directions))
        ]
    if touch.height_map is None:
        return [relief, steepness, *layers, moment]
    height = partial(height_panel, height_map=touch.height_map, reading=reading)
    return [height, relief, moment, steepness, *layers]
