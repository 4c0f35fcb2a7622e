"""Pictures of how a part was felt and read, for people: plate frame, millimetres, row 0 at the top.

+---------------------+---------------------+
| height map, boxes   | height felt, depths |
+---------------------+---------------------+
| moment map          | steepness felt      |
+---------------------+---------------------+
| edge map, one picture a trace direction   |
+-------------------------------------------+
| candidates of every place                 |
+-------------------------------------------+
  what to know about the reading

Of a scan there is no height map; its moments come last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from glyphs.errors import FileError
from pipeline.common.atomic import check_writable, replacing
from pipeline.plots.axes import (
    BOX_COLOUR,
    candidate_panel,
    edge_panel,
    height_panel,
    moment_panel,
    relief_panel,
    steepness_panel,
)

if TYPE_CHECKING:
    from recognition.reading import Reading

_SUFFIXES = (".png", ".svg", ".pdf")


def check_picture(path: Path) -> None:
    """Refuse, before the work starts, a picture that could not be written.

    Raises:
        FileError: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise FileError(path, "is no picture that can be drawn", f"end it in {', '.join(_SUFFIXES)}")
    check_writable(path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write the figure; the file appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    check_picture(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


def inspect_figure(reading: Reading, *, title: str) -> Figure:
    """All that is known of one part by touch."""
    trace = reading.trace
    edges = trace.edge_map
    layers = (
        [partial(edge_panel, edges=edges, layer=k) for k in range(len(edges.directions))] if edges else []
    )
    relief, steepness = partial(relief_panel, trace=trace), partial(steepness_panel, trace=trace)
    moment = partial(moment_panel, trace=trace)
    panels = [relief, steepness, *layers, moment]
    if trace.height_map is not None:
        panels = [partial(height_panel, height_map=trace.height_map), relief, moment, steepness, *layers]
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(12.0, 3.5 + 2.1 * rows), dpi=110, layout="constrained")
    figure.suptitle(f"{title}: {headline(reading)}", fontsize=13, fontweight="bold")
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.15] + [1.0] * (rows - 1) + [1.05])
    for k, draw in enumerate(panels):
        draw(figure.add_subplot(grid[k // 2, k % 2]), reading=reading)
    candidate_panel(figure.add_subplot(grid[rows, :]), reading)
    if reading.characters and reading.messages():
        figure.supxlabel(
            "\n".join(reading.messages()), fontsize=9.5, color=BOX_COLOUR, x=0.01, ha="left", parse_math=False
        )
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
    if reading.depth_min_mm is not None:
        facts.append(f"{'standing' if reading.raised else 'deep'} {reading.depth_min_mm:.3f} mm at least")
    return ", ".join([found, *facts])


@dataclass(frozen=True, eq=False)
class SheetPart:
    """One part of the overview: its name, what was stamped on it and how it was read."""

    name: str
    truth: str
    reading: Reading


def overview_figure(parts: Sequence[SheetPart]) -> Figure:
    """A sheet of parts: relief with boxes, what the whiskers felt, text read against the truth."""
    figure = Figure(figsize=(12.0, 0.4 + 2.3 * len(parts)), dpi=110, layout="constrained")
    axes = figure.subplots(len(parts), 2, squeeze=False)
    for (left, right), part in zip(axes, parts, strict=True):
        reading = part.reading
        trace = reading.trace
        right_or_wrong = "right" if same_text(reading.text, part.truth) else "WRONG"
        height_panel(left, height_map=trace.height_map, reading=reading, colour_bar=False)
        left.set_title(f"{part.name}: {headline(reading)}", fontsize=8.5, loc="left")
        if trace.edge_map is not None:
            edge_panel(right, edges=trace.edge_map, layer=0, reading=reading, colour_bar=False)
        right.set_title(
            f"felt along x; stamped “{part.truth}”, read {right_or_wrong}", fontsize=8.5, loc="left"
        )
    return figure


def same_text(one: str, other: str) -> bool:
    """Whether two serials are the same; spaces are not stamped."""
    return "".join(one.split()) == "".join(other.split())
