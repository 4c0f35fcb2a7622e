"""Pictures as files, a reading in one line, and the overview of a demonstration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from glyphs.atomic import check_writable, replacing
from glyphs.errors import FileError
from pipeline.common.texts import same_text
from recognition.decision.panels import edge_panel, height_panel

if TYPE_CHECKING:
    from recognition.decision.reading import Reading

_SUFFIXES = (".png", ".svg", ".pdf")


def check_picture(path: Path) -> None:
    """Refuse, before the work starts, a picture that could not be written.

    Raises:
        FileError: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise FileError(path, "is not a picture that can be drawn", f"end it in {', '.join(_SUFFIXES)}")
    check_writable(path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write the figure; the file appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    check_picture(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


@dataclass(frozen=True, eq=False)
class SheetPart:
    """One part of the overview: its name, what was stamped on it and how it was read."""

    name: str
    truth: str
    reading: Reading


def overview_figure(parts: Sequence[SheetPart]) -> Figure:
    """A sheet of parts: relief with what was stamped, edge map with what was read."""
    figure = Figure(figsize=(12.0, 0.4 + 2.3 * len(parts)), dpi=110, layout="constrained")
    axes = figure.subplots(len(parts), 2, squeeze=False)
    for (left, right), part in zip(axes, parts, strict=True):
        reading, trace = part.reading, part.reading.trace
        if trace.height_map is not None:
            height_panel(left, height_map=trace.height_map, reading=reading, colour_bar=False)
        left.set_title(f"{part.name}: “{part.truth}” stamped", fontsize=9, loc="left")
        if trace.edge_map is not None:
            edge_panel(right, edges=trace.edge_map, layer=0, reading=reading, colour_bar=False)
        verdict = "right" if same_text(reading.text, part.truth) else "WRONG"
        right.set_title(
            f"by touch: “{reading.text}”, {verdict}, {reading.decision.value}, confidence {reading.confidence:.3f}"
            f"{reading.font and f', {reading.font}'}",
            fontsize=9,
            loc="left",
        )
    return figure
