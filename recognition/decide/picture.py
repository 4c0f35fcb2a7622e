"""Draw the picture of one part: all measurements and the reading, mm, row 0 at the top.

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

For a part that is less than twice as wide as high, a row has four panels. There are panels only for existing data. A
recorded scan has no height map; its moments come last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.scan.scan import only

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import EdgeMap, HeightMap
    from recognition import CharacterReading, Reading, ReadingTrace
    from whisker_array.estimation.relief import Relief
    from whisker_array.scan.sweep import Sweep

BOX_COLOUR = "#e4572e"
Extent = tuple[float, float, float, float]


def reading_figure(reading: Reading, *, title: str = "", figure: Figure | None = None) -> Figure:
    """Draw all measurements and the reading of one part (default: on a new figure)."""
    photo, touch = reading.trace.photo, reading.touch
    panels: list[Callable[[Axes], None]] = []
    if photo is not None:
        # felt boxes can be drawn only if the place of the photograph on the plate is known
        shown = reading.vision or (None if photo.centre_mm is None else reading)
        panels.append(partial(photo_panel, photo=photo, reading=shown))
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
    photo, edges = reading.trace.photo, None if reading.touch is None else reading.touch.trace.edge_map
    shape = (0, 0) if photo is None else photo.shape
    rows, columns = shape if edges is None else edges.valid.shape
    return bool(columns >= 2 * rows)


def _touch_panels(touch: ReadingTrace, reading: Reading) -> Iterator[Callable[[Axes], None]]:
    edges, scan, surface, relief = touch.edge_map, touch.scan, touch.height_map, touch.relief
    if surface is not None:
        yield partial(height_panel, height_map=surface, reading=reading)
    if relief is not None:
        yield partial(relief_panel, relief=relief, reading=reading, labelled=surface is None)
    if scan is not None and surface is not None:
        yield partial(moment_panel, sweep=only(scan).sweeps[0])
    if relief is not None and (relief.slope_x is not None or relief.slope_y is not None):
        # slower than the reader's own relief, but more accurate at walls
        steep = relief if scan is None or edges is None else estimate_relief(scan, edges)
        yield partial(steepness_panel, relief=steep, reading=reading)
    if edges is not None:
        for layer in range(len(edges.directions)):
            yield partial(edge_panel, edges=edges, layer=layer, reading=reading)
    if scan is not None and surface is None:
        yield partial(moment_panel, sweep=only(scan).sweeps[0])


def height_panel(axes: Axes, *, height_map: HeightMap, reading: Reading, colour_bar: bool = True) -> None:
    """Draw the part's own heights with the characters that were read."""
    z, bar = height_map.z_mm, "mm" if colour_bar else ""
    _map(axes, "height map, levelled", z, _extent(z.shape, height_map.pitch_mm), bar=bar)
    _boxes(axes, reading, labelled=True)


def relief_panel(axes: Axes, *, relief: Relief, reading: Reading, labelled: bool) -> None:
    """Draw the heights by touch with the depth of every character, and the characters if `labelled`."""
    depths = "\nleast and mean depth of each character" if reading.depth_min_mm is not None else ""
    z = relief.height_mm
    _map(axes, f"height by touch{depths}", z, _extent(z.shape, relief.pitch_mm, relief.origin_mm), bar="mm")
    _boxes(axes, reading, labelled=labelled)
    for character in reading.characters:
        depth, box = character.depth, character.box
        text = "?" if depth is None else f"{depth.min_mm:.3f}\n{depth.mean_mm:.3f}"
        white = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.0}
        size = min(7.5, 90.0 / len(reading.characters))
        _label(axes, text, (0.5 * (box.x0_mm + box.x1_mm), box.y1_mm), color="#1b2a41", size=size, bbox=white)


def steepness_panel(axes: Axes, *, relief: Relief, reading: Reading) -> None:
    """Draw the steepness of the surface by touch, for a relief with slopes."""
    known = "assumed" if relief.friction_sd is None else "measured"
    title = f"steepness by touch, |slope|\nfriction {relief.friction:.3f} {known}"
    steep, extent = relief.steepness, _extent(relief.steepness.shape, relief.pitch_mm, relief.origin_mm)
    _map(axes, title, steep, extent, cmap="magma", limits=(0.0, _spread(steep)[1]), bar="mm / mm")
    _boxes(axes, reading)


def moment_panel(axes: Axes, *, sweep: Sweep) -> None:
    """Draw the raw moments of one direction, without boxes: the tip lags, so they would be misplaced."""
    title = f"raw moment, traced {int(sweep.plan.direction)}°\n{sweep.plan.line_mm.size} lines"
    _map(axes, title, *moment_image(sweep), cmap="magma", bar="N mm")


def moment_image(sweep: Sweep) -> tuple[NDArray[np.float32], Extent]:
    """The raw moments of one direction as a picture in the plate frame, and its extent; NaN where flagged."""
    plan, along = sweep.plan, sweep.plan.position_mm()
    order = np.argsort(plan.line_mm, axis=None, kind="stable")
    lines = plan.line_mm.ravel()[order]
    moment = np.where(sweep.flags == 0, sweep.moment_n_mm, np.nan).reshape(-1, plan.n_samples)[order]
    felt = np.isfinite(moment).any(axis=1)
    if felt.any():
        moment, lines = moment[felt], lines[felt]
    if plan.direction.backward:
        moment, along = moment[:, ::-1], along[::-1]
    a = (float(along[0]), float(along[-1]))
    c = (float(lines[0]), float(lines[-1]) if lines[-1] > lines[0] else float(lines[0]) + plan.step_mm)
    if plan.direction.along_x:
        return moment.astype(np.float32), (*a, c[1], c[0])
    return moment.T.astype(np.float32), (*c, a[1], a[0])


def edge_panel(axes: Axes, *, edges: EdgeMap, layer: int, reading: Reading, colour_bar: bool = True) -> None:
    """Draw one layer of the edge map."""
    values = np.where(edges.valid, edges.enhancement[layer], np.nan).astype(np.float32)
    finite = np.abs(values[np.isfinite(values)])
    most = max(float(np.percentile(finite, 99.0)) if finite.size else 0.0, 1e-3)
    title, bar = f"edge map, traced {int(edges.directions[layer])}°", "m / m_land - 1" if colour_bar else ""
    extent = _extent(values.shape, edges.pitch_mm, edges.origin_mm)
    _map(axes, title, values, extent, cmap="RdBu_r", limits=(-most, most), bar=bar)
    _boxes(axes, reading)


def photo_panel(axes: Axes, *, photo: Photo, reading: Reading | None) -> None:
    """Draw the photograph with the boxes of a reading."""
    title, unit = ("photograph", "mm") if photo.pitch_mm else ("photograph, pixels", "pixels")
    extent = _extent(photo.shape, photo_pitch_mm(photo), photo_origin_mm(photo))
    # without limits grey pictures would be stretched from black to white
    _map(axes, title, photo.eight_bit, extent, cmap="gray", limits=(0, 255), unit=unit)
    if reading is not None:
        _boxes(axes, reading, labelled=True)


def _map(
    axes: Axes,
    title: str,
    values: NDArray[Any],
    extent: Extent,
    *,
    cmap: str = "cividis",
    limits: tuple[float, float] | None = None,
    bar: str = "",
    unit: str = "mm",
    most_a_side: int = 1600,
) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    low, high = _spread(values) if limits is None else limits
    rows, columns = (max(1, -(-n // most_a_side)) for n in values.shape[:2])
    thinned = values[::rows, ::columns]
    image = axes.imshow(thinned, cmap=cmap, extent=extent, vmin=low, vmax=high, interpolation="nearest")
    axes.set_xlabel(f"x, {unit}", fontsize=7)
    axes.set_ylabel(f"y, {unit}", fontsize=7)
    axes.tick_params(labelsize=7)
    if bar:
        colours = axes.figure.colorbar(image, ax=axes, fraction=0.025, pad=0.01)
        colours.ax.tick_params(labelsize=7)
        colours.set_label(bar, fontsize=7)


def _extent(shape: tuple[int, ...], pitch_mm: float, origin_mm: tuple[float, float] = (0.0, 0.0)) -> Extent:
    x0, y0 = origin_mm[0] - 0.5 * pitch_mm, origin_mm[1] - 0.5 * pitch_mm
    return (x0, x0 + shape[1] * pitch_mm, y0 + shape[0] * pitch_mm, y0)


def _spread(values: NDArray[np.float32]) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return (-1.0, 1.0)
    low, high = (float(v) for v in np.percentile(finite, [0.5, 99.5]))
    return (low, high) if high > low else (low - 1e-6, low + 1e-6)


def _boxes(axes: Axes, reading: Reading, *, labelled: bool = False) -> None:
    top = min(axes.get_ylim())
    for character in reading.characters:
        box = character.box
        corner, width = (box.x0_mm, box.y0_mm), box.x1_mm - box.x0_mm
        frame = Rectangle(corner, width, box.y1_mm - box.y0_mm, fill=False, edgecolor=BOX_COLOUR, lw=0.9)
        axes.add_patch(frame)
        if labelled:
            outline = [withStroke(linewidth=2.0, foreground="white")]
            place, above = (corner[0] + 0.5 * width, max(corner[1], top)), corner[1] > top
            style = {"color": BOX_COLOUR, "size": 10, "weight": "bold", "path_effects": outline}
            _label(axes, character.char, place, above=above, **style)


def _label(axes: Axes, text: str, place: tuple[float, float], *, above: bool = False, **style: Any) -> None:
    offset, side = (1.5, "bottom") if above else (-3.0, "top")
    axes.annotate(text, place, (0, offset), textcoords="offset points", ha="center", va=side, **style)


def candidate_panel(axes: Axes, reading: Reading, *, most_shown: int = 4) -> None:
    """Draw the first candidates of every place and their probabilities; below them state and grade of the mark."""
    characters = reading.characters
    more = ", its state and its mark's grade" if any(c.grade is not None for c in characters) else ""
    axes.set_title(f"candidates of each place and the belief in them{more}", fontsize=9, loc="left")
    axes.set_axis_off()
    if not characters:
        why = "; ".join(reading.messages()) or "no characters found"
        axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)
        return
    for place, character in enumerate(characters):
        for rank, candidate in enumerate(character.candidates[:most_shown]):
            belief = min(1.0, max(0.0, candidate.probability))
            colour = BOX_COLOUR if rank == 0 else "#7a8b99"
            axes.barh(-rank, 0.55 * belief, left=place + 0.36, height=0.6, color=colour, alpha=0.75)
            axes.text(
                place + 0.3, -rank, candidate.char, ha="right", va="center", size=12, family="monospace"
            )
            axes.text(place + 0.38, -rank, f"{belief:.3f}", va="center", fontsize=7)
        axes.text(place + 0.2, -most_shown + 0.25, _judgement(character), va="top", fontsize=7)
    axes.set_xlim(-0.1, max(8, len(characters)))
    axes.set_ylim(-most_shown + (-0.9 if any(map(_judgement, characters)) else 0.3), 0.7)


def _judgement(character: CharacterReading) -> str:
    state = character.state
    lines = (
        [] if state is None else [f"{state.state.value} {'/'.join(c or '-' for c in state.chars)}".strip()]
    )
    if character.grade is not None:
        why = character.grade.limiting
        lines.append(f"grade {character.grade.letter}" + (f", {why}" if why else ""))
    return "\n".join(lines)
