"""Style of all pictures, writing of picture files, and the overview of the demo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glyphs.atomic import replacing
from pipeline.common.output_paths import PICTURES, check_writable
from pipeline.common.texts import same_text
from recognition.decide.picture import edge_panel, height_panel

if TYPE_CHECKING:
    from glyphs.surface.maps import HeightMap
    from recognition.decide.reading import Reading

# colours of Okabe and Ito: distinct for colour-blind readers, and in grey
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
STEEL, PALE = "#3b5b7a", "#a5b5c7"

# decorator that gives drawing functions the common style
styled = rc_context(
    {
        "figure.dpi": 110,
        "figure.constrained_layout.use": True,
        "figure.titlesize": 11,
        "font.size": 8,
        "axes.titlesize": 10,
        "axes.titlelocation": "left",
        "axes.labelsize": 9,
        "axes.axisbelow": True,
        "grid.color": "0.9",
        "legend.frameon": False,
    }
)


def note(
    axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], **style: Any
) -> None:
    """Write text beside a data point, `offset` points to the right and above."""
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **style)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure whole or not at all, always as the same bytes. Raises FileError: it cannot be written."""
    check_writable(path, PICTURES)
    # without a fixed salt the names inside an SVG are random
    with rc_context({"svg.hashsalt": path.stem}), replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower())


def reading_panels(left: Axes, right: Axes, reading: Reading, surface: HeightMap | None = None) -> None:
    """Draw the height map (default: that which was scanned) and the edge map of a reading with its characters."""
    heights, edges = surface or reading.trace.height_map, reading.trace.edge_map
    if heights is not None:
        height_panel(left, height_map=heights, reading=reading, colour_bar=False)
    if edges is not None:
        edge_panel(right, edges=edges, layer=0, reading=reading, colour_bar=False)
    else:
        right.text(0.5, 0.5, "no edge map", ha="center", va="center")


@dataclass(frozen=True, eq=False)
class SheetPart:
    """One part of the overview: its name, the text stamped on it, its reading, and its surface if known."""

    name: str
    truth: str
    reading: Reading
    surface: HeightMap | None = None

    @property
    def right(self) -> bool:
        return same_text(self.reading.text, self.truth)


@styled
def overview_figure(parts: Sequence[SheetPart]) -> Figure:
    """Draw a sheet of parts: height map with the stamped text, edge map with the text read."""
    figure = Figure(figsize=(12.0, 0.4 + 2.3 * len(parts)))
    for (left, right), part in zip(figure.subplots(len(parts), 2, squeeze=False), parts, strict=True):
        reading = part.reading
        reading_panels(left, right, reading, part.surface)
        left.set_title(f"{part.name}: “{part.truth}” stamped")
        verdict = "right" if part.right else "WRONG"
        confidence = f"{reading.confidence:.3f}{reading.font and f', {reading.font}'}"
        right.set_title(
            f"by touch: “{reading.text}”, {verdict}, {reading.decision.value}, confidence {confidence}"
        )
    return figure
