"""Pictures of how a part was felt and read, for people: plate frame, millimetres, row 0 at the top.

+---------------------+---------------------+
| height map, boxes   | moment map          |
+---------------------+---------------------+
| edge map, one picture a trace direction   |
+-------------------------------------------+
| candidates of every place                 |
+-------------------------------------------+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from pipeline.atomic import check_writable, replacing
from pipeline.problems import FileProblem

if TYPE_CHECKING:
    from glyphs.maps import EdgeMap, HeightMap
    from recognition.reader import ReadingWithEvidence
    from recognition.reading import Reading
    from whisker_array.scan import Sweep

_SUFFIXES = (".png", ".svg", ".pdf")
_MOST_PIXELS_A_SIDE = 1600
_SHOWN_CANDIDATES = 4
_BOX_COLOUR = "#e4572e"
Extent = tuple[float, float, float, float]


def check_picture(path: Path) -> None:
    """Refuse, before the work starts, a picture that could not be written.

    Raises:
        FileProblem: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise FileProblem(path, "is no picture that can be drawn", f"end it in {', '.join(_SUFFIXES)}")
    check_writable(path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write the figure; the file appears whole or not at all.

    Raises:
        FileProblem: it cannot be written.
    """
    check_picture(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


def inspect_figure(evidence: ReadingWithEvidence, *, title: str) -> Figure:
    """All that is known of one part."""
    reading, edges = evidence.reading, evidence.edge_map
    n_edges = len(edges.directions) if edges is not None else 0
    edge_rows = (n_edges + 1) // 2
    figure = Figure(figsize=(12.0, 5.4 + 2.1 * edge_rows), dpi=110, layout="constrained")
    figure.suptitle(f"{title}: {headline(reading)}", fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(2 + edge_rows, 2, height_ratios=[1.15] + [1.0] * edge_rows + [1.05])
    _height_panel(figure.add_subplot(grid[0, 0]), evidence.height_map, reading)
    _moment_panel(figure.add_subplot(grid[0, 1]), evidence)
    if edges is not None:
        for k in range(n_edges):
            _edge_panel(figure.add_subplot(grid[1 + k // 2, k % 2]), edges, k, reading)
    _candidate_panel(figure.add_subplot(grid[1 + edge_rows, :]), reading)
    return figure


def headline(reading: Reading) -> str:
    """The reading in one line."""
    found = (
        f"“{reading.text}”, {reading.decision.value}, confidence {reading.confidence:.3f}"
        if reading.text
        else "no characters"
    )
    facts = [f"{reading.font}"] if reading.font else []
    if reading.height_mm:
        kind = "raised" if reading.raised else "sunk"
        facts.append(f"{reading.height_mm:.2f} mm, {kind}, {reading.rotation_deg:+.1f}°")
    return ", ".join([found, *facts])


@dataclass(frozen=True, eq=False)
class SheetPart:
    """One part of the overview: its evidence, its name and what was stamped on it."""

    name: str
    truth: str
    evidence: ReadingWithEvidence


def overview_figure(parts: Sequence[SheetPart]) -> Figure:
    """A sheet of parts: relief with boxes, what the whiskers felt, text read against the truth."""
    figure = Figure(figsize=(12.0, 0.4 + 2.3 * len(parts)), dpi=110, layout="constrained")
    axes = figure.subplots(len(parts), 2, squeeze=False)
    for (left, right), part in zip(axes, parts, strict=True):
        reading = part.evidence.reading
        right_or_wrong = "right" if same_text(reading.text, part.truth) else "WRONG"
        _height_panel(left, part.evidence.height_map, reading, colour_bar=False)
        left.set_title(f"{part.name}: {headline(reading)}", fontsize=8.5, loc="left")
        if part.evidence.edge_map is not None:
            _edge_panel(right, part.evidence.edge_map, 0, reading, colour_bar=False)
        right.set_title(
            f"felt along x; stamped “{part.truth}”, read {right_or_wrong}", fontsize=8.5, loc="left"
        )
    return figure


def same_text(one: str, other: str) -> bool:
    """Whether two serials are the same; spaces are not stamped."""
    return "".join(one.split()) == "".join(other.split())


def _thinned(values: NDArray[np.float32]) -> NDArray[np.float32]:
    steps = [max(1, -(-n // _MOST_PIXELS_A_SIDE)) for n in values.shape]
    return values[:: steps[0], :: steps[1]]


def _picture(
    axes: Axes,
    values: NDArray[np.float32],
    extent: Extent,
    *,
    cmap: str,
    limits: tuple[float, float],
    bar: str,
) -> None:
    image = axes.imshow(
        _thinned(values), cmap=cmap, extent=extent, vmin=limits[0], vmax=limits[1], interpolation="nearest"
    )
    axes.set_xlabel("x, mm", fontsize=7)
    axes.set_ylabel("y, mm", fontsize=7)
    axes.tick_params(labelsize=7)
    if bar:
        colours = axes.figure.colorbar(image, ax=axes, fraction=0.025, pad=0.01)
        colours.ax.tick_params(labelsize=7)
        colours.set_label(bar, fontsize=7)


def _extent(shape: tuple[int, ...], pitch_mm: float, origin_mm: tuple[float, float] = (0.0, 0.0)) -> Extent:
    """Edges of the pixels for imshow: left, right, bottom, top."""
    x0, y0 = origin_mm[0] - 0.5 * pitch_mm, origin_mm[1] - 0.5 * pitch_mm
    return (x0, x0 + shape[1] * pitch_mm, y0 + shape[0] * pitch_mm, y0)


def _spread(values: NDArray[np.float32], low: float, high: float) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return (-1.0, 1.0)
    a, b = (float(v) for v in np.percentile(finite, [low, high]))
    return (a, b) if b > a else (a - 1e-6, a + 1e-6)


def _say(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)
    axes.set_axis_off()


def _height_panel(
    axes: Axes, height_map: HeightMap | None, reading: Reading, *, colour_bar: bool = True
) -> None:
    axes.set_title("height map, levelled", fontsize=9, loc="left")
    if height_map is None:
        _say(axes, "read from a scan: no height map")
        return
    z = height_map.z_mm
    bar = "mm" if colour_bar else ""
    extent = _extent(z.shape, height_map.pitch_mm)
    _picture(axes, z, extent, cmap="cividis", limits=_spread(z, 0.5, 99.5), bar=bar)
    _boxes(axes, reading)


def _boxes(axes: Axes, reading: Reading, *, labelled: bool = True) -> None:
    for character in reading.characters:
        box = character.box
        width, height = box.x1_mm - box.x0_mm, box.y1_mm - box.y0_mm
        axes.add_patch(
            Rectangle((box.x0_mm, box.y0_mm), width, height, fill=False, edgecolor=_BOX_COLOUR, linewidth=0.9)
        )
        if labelled:
            axes.annotate(
                character.char,
                (box.x0_mm + 0.5 * width, box.y0_mm),
                xytext=(0, 1.5),
                textcoords="offset points",
                ha="center",
                va="bottom",
                color=_BOX_COLOUR,
                fontsize=10,
                fontweight="bold",
            )


def _moment_panel(axes: Axes, evidence: ReadingWithEvidence) -> None:
    if evidence.scan is None:
        _say(axes, "no scan")
        return
    sweep = evidence.scan.sweeps[0]
    axes.set_title(
        f"raw moment, traced {int(sweep.plan.direction)}°, {sweep.plan.line_mm.size} lines",
        fontsize=9,
        loc="left",
    )
    values, extent = moment_image(sweep)
    _picture(axes, values, extent, cmap="magma", limits=_spread(values, 0.5, 99.5), bar="N mm")


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


def _edge_panel(axes: Axes, edges: EdgeMap, layer: int, reading: Reading, *, colour_bar: bool = True) -> None:
    values = np.where(edges.valid, edges.enhancement[layer], np.nan).astype(np.float32)
    finite = np.abs(values[np.isfinite(values)])
    most = max(float(np.percentile(finite, 99.0)) if finite.size else 0.0, 1e-3)
    axes.set_title(f"edge map, traced {int(edges.directions[layer])}°", fontsize=9, loc="left")
    extent = _extent(values.shape, edges.pitch_mm, edges.origin_mm)
    bar = "m / m_land - 1" if colour_bar else ""
    _picture(axes, values, extent, cmap="RdBu_r", limits=(-most, most), bar=bar)
    _boxes(axes, reading, labelled=False)


def _candidate_panel(axes: Axes, reading: Reading) -> None:
    axes.set_title("candidates of each place and the belief in them", fontsize=9, loc="left")
    if not reading.characters:
        _say(axes, "; ".join(reading.flags.messages()) or "no characters were found")
        return
    for place, character in enumerate(reading.characters):
        for rank, candidate in enumerate(character.candidates[:_SHOWN_CANDIDATES]):
            belief = min(1.0, max(0.0, candidate.probability))
            y = -float(rank)
            colour = _BOX_COLOUR if rank == 0 else "#7a8b99"
            axes.barh(y, 0.55 * belief, left=place + 0.36, height=0.6, color=colour, alpha=0.75)
            axes.text(
                place + 0.3, y, candidate.char, ha="right", va="center", fontsize=12, family="monospace"
            )
            axes.text(place + 0.38, y, f"{belief:.3f}", va="center", fontsize=7)
    axes.set_xlim(-0.1, max(8, len(reading.characters)))
    axes.set_ylim(-_SHOWN_CANDIDATES + 0.3, 0.7)
    axes.set_axis_off()
    messages = reading.flags.messages()
    if messages:
        axes.text(0.0, -0.04, "; ".join(messages), transform=axes.transAxes, fontsize=8, va="top")
