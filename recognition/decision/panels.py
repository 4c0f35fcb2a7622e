"""The panels of the pictures: one map, or one table of candidates, on one pair of axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from recognition.views.photo_frame import photo_origin_mm, photo_pitch_mm

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import EdgeMap, HeightMap
    from recognition import CharacterReading, Reading
    from whisker_array.estimation.relief import Relief
    from whisker_array.scan.sweep import Sweep

BOX_COLOUR = "#e4572e"
Extent = tuple[float, float, float, float]


def _map(
    axes: Axes,
    title: str,
    values: NDArray[Any],
    extent: Extent,
    *,
    cmap: str,
    limits: tuple[float, float],
    bar: str = "",
    unit: str = "mm",
    reading: Reading | None = None,
    labelled: bool = False,
    most_a_side: int = 1600,
) -> None:
    """One map under its title, with a bar of its colours where that has a name, and a reading's boxes."""
    axes.set_title(title, fontsize=9, loc="left")
    every = [max(1, -(-n // most_a_side)) for n in values.shape[:2]]
    thinned = values[:: every[0], :: every[1]]
    image = axes.imshow(
        thinned, cmap=cmap, extent=extent, vmin=limits[0], vmax=limits[1], interpolation="nearest"
    )
    axes.set_xlabel(f"x, {unit}", fontsize=7)
    axes.set_ylabel(f"y, {unit}", fontsize=7)
    axes.tick_params(labelsize=7)
    if bar:
        colours = axes.figure.colorbar(image, ax=axes, fraction=0.025, pad=0.01)
        colours.ax.tick_params(labelsize=7)
        colours.set_label(bar, fontsize=7)
    if reading is not None:
        _boxes(axes, reading, labelled=labelled)


def _boxes(axes: Axes, reading: Reading, *, labelled: bool) -> None:
    top = min(axes.get_ylim())
    for character in reading.characters:
        box = character.box
        width, height = box.x1_mm - box.x0_mm, box.y1_mm - box.y0_mm
        above = box.y0_mm > top  # else there is no room over the box
        axes.add_patch(
            Rectangle((box.x0_mm, box.y0_mm), width, height, fill=False, edgecolor=BOX_COLOUR, linewidth=0.9)
        )
        if labelled:
            axes.annotate(
                character.char,
                (box.x0_mm + 0.5 * width, max(box.y0_mm, top)),
                xytext=(0, 1.5 if above else -3.0),
                textcoords="offset points",
                ha="center",
                va="bottom" if above else "top",
                color=BOX_COLOUR,
                fontsize=10,
                fontweight="bold",
                path_effects=[withStroke(linewidth=2.0, foreground="white")],
            )


def _extent(shape: tuple[int, ...], pitch_mm: float, origin_mm: tuple[float, float] = (0.0, 0.0)) -> Extent:
    """Edges of the pixels for imshow: left, right, bottom, top."""
    x0, y0 = origin_mm[0] - 0.5 * pitch_mm, origin_mm[1] - 0.5 * pitch_mm
    return (x0, x0 + shape[1] * pitch_mm, y0 + shape[0] * pitch_mm, y0)


def _spread(values: NDArray[np.float32]) -> tuple[float, float]:
    """The range of all but the outermost half per cent either way."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return (-1.0, 1.0)
    low, high = (float(v) for v in np.percentile(finite, [0.5, 99.5]))
    return (low, high) if high > low else (low - 1e-6, low + 1e-6)


def height_panel(axes: Axes, *, height_map: HeightMap, reading: Reading, colour_bar: bool = True) -> None:
    """The part's own heights with the characters read."""
    z = height_map.z_mm
    _map(
        axes, "height map, levelled", z, _extent(z.shape, height_map.pitch_mm), cmap="cividis",
        limits=_spread(z), bar="mm" if colour_bar else "", reading=reading, labelled=True,
    )  # fmt: skip


def relief_panel(axes: Axes, *, relief: Relief, reading: Reading, labelled: bool) -> None:
    """Heights by touch, the depth of every character, and the characters if they are to be named."""
    depths = "\nleast and mean depth of each character" if reading.depth_min_mm is not None else ""
    z = relief.height_mm
    _map(
        axes, f"height by touch{depths}", z, _extent(z.shape, relief.pitch_mm, relief.origin_mm),
        cmap="cividis", limits=_spread(z), bar="mm", reading=reading, labelled=labelled,
    )  # fmt: skip
    size = min(7.5, 90.0 / max(1, len(reading.characters)))
    for character in reading.characters:
        depth, box = character.depth, character.box
        axes.annotate(
            "?" if depth is None else f"{depth.min_mm:.3f}\n{depth.mean_mm:.3f}",
            (0.5 * (box.x0_mm + box.x1_mm), box.y1_mm),
            xytext=(0, -3.0),
            textcoords="offset points",
            ha="center",
            va="top",
            color="#1b2a41",
            fontsize=size,
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.0},
        )


def steepness_panel(axes: Axes, *, relief: Relief, reading: Reading) -> None:
    """Steepness of the surface by touch; the relief has slopes."""
    known = "assumed" if relief.friction_sd is None else "measured"
    title = f"steepness by touch, |slope|\nfriction {relief.friction:.3f} {known}"
    steep = relief.steepness
    _map(
        axes, title, steep, _extent(steep.shape, relief.pitch_mm, relief.origin_mm), cmap="magma",
        limits=(0.0, _spread(steep)[1]), bar="mm / mm", reading=reading,
    )  # fmt: skip


def moment_panel(axes: Axes, *, sweep: Sweep) -> None:
    """The raw moments of one direction; characters are not shown, the tip lags."""
    title = f"raw moment, traced {int(sweep.plan.direction)}°\n{sweep.plan.line_mm.size} lines"
    values, extent = moment_image(sweep)
    _map(axes, title, values, extent, cmap="magma", limits=_spread(values), bar="N mm")


def moment_image(sweep: Sweep) -> tuple[NDArray[np.float32], Extent]:
    """The raw moments of one direction as a picture in the plate frame, and its extent; NaN where flagged."""
    lines = sweep.plan.line_mm.ravel()
    order = np.argsort(lines, kind="stable")
    n = sweep.plan.n_samples
    moment = np.where(sweep.flags == 0, sweep.moment_n_mm, np.nan).reshape(-1, n)[order]
    along, lines = sweep.plan.position_mm(), lines[order]
    felt = np.isfinite(moment).any(axis=1)
    if felt.any():
        moment, lines = moment[felt], lines[felt]
    if sweep.plan.direction.backward:
        moment, along = moment[:, ::-1], along[::-1]
    a = (float(along[0]), float(along[-1]))
    c = (float(lines[0]), float(lines[-1]) if lines[-1] > lines[0] else float(lines[0]) + sweep.plan.step_mm)
    if sweep.plan.direction.along_x:
        return moment.astype(np.float32), (*a, c[1], c[0])
    return moment.T.astype(np.float32), (*c, a[1], a[0])


def edge_panel(axes: Axes, *, edges: EdgeMap, layer: int, reading: Reading, colour_bar: bool = True) -> None:
    """One layer of the edge map."""
    values = np.where(edges.valid, edges.enhancement[layer], np.nan).astype(np.float32)
    finite = np.abs(values[np.isfinite(values)])
    most = max(float(np.percentile(finite, 99.0)) if finite.size else 0.0, 1e-3)
    _map(
        axes, f"edge map, traced {int(edges.directions[layer])}°", values,
        _extent(values.shape, edges.pitch_mm, edges.origin_mm), cmap="RdBu_r", limits=(-most, most),
        bar="m / m_land - 1" if colour_bar else "", reading=reading,
    )  # fmt: skip


def photo_panel(axes: Axes, *, photo: Photo, reading: Reading | None) -> None:
    """The photograph, with what the camera read; boxes in its own frame."""
    unit = "mm" if photo.pitch_mm else "pixels"
    # without limits grey pictures would be stretched from black to white
    _map(
        axes, "photograph" if photo.pitch_mm else "photograph, pixels", photo.eight_bit,
        _extent(photo.shape, photo_pitch_mm(photo), photo_origin_mm(photo)), cmap="gray",
        limits=(0, 255), unit=unit, reading=reading, labelled=True,
    )  # fmt: skip


def candidate_panel(axes: Axes, reading: Reading, *, most_shown: int = 4) -> None:
    """The first candidates of every place and the belief in them; below them state and grade of the mark."""
    graded = any(c.grade is not None for c in reading.characters)
    more = ", its state and its mark's grade" if graded else ""
    axes.set_title(f"candidates of each place and the belief in them{more}", fontsize=9, loc="left")
    if not reading.characters:
        why = "; ".join(reading.messages()) or "no characters found"
        axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    for place, character in enumerate(reading.characters):
        for rank, candidate in enumerate(character.candidates[:most_shown]):
            belief = min(1.0, max(0.0, candidate.probability))
            y = -float(rank)
            colour = BOX_COLOUR if rank == 0 else "#7a8b99"
            axes.barh(y, 0.55 * belief, left=place + 0.36, height=0.6, color=colour, alpha=0.75)
            axes.text(
                place + 0.3, y, candidate.char, ha="right", va="center", fontsize=12, family="monospace"
            )
            axes.text(place + 0.38, y, f"{belief:.3f}", va="center", fontsize=7)
        axes.text(place + 0.2, -most_shown + 0.25, _judgement(character), va="top", fontsize=7)
    axes.set_xlim(-0.1, max(8, len(reading.characters)))
    judged = any(_judgement(c) for c in reading.characters)
    axes.set_ylim(-most_shown + (-0.9 if judged else 0.3), 0.7)
    axes.set_axis_off()


def _judgement(character: CharacterReading) -> str:
    """State and grade of one place, a line each."""
    state = character.state
    lines = (
        [] if state is None else [f"{state.state.value} {'/'.join(c or '-' for c in state.chars)}".strip()]
    )
    if character.grade is not None:
        why = character.grade.limiting
        lines.append(f"grade {character.grade.letter}" + (f", {why}" if why else ""))
    return "\n".join(lines)
