"""Active touch as a moving picture: lines being felt one pass after the other, beliefs growing, the stop.

    +---------------------------------------+
    |  the part, lines felt; the last bright |   above: what lies under the whiskers
    +---------------------------------------+
    |  what the whiskers have found so far   |   middle: their edge map
    +---------------------------------------+
    |  K   X   4 ...  bars of belief         |   below: a bar a place; the clock of stage time; why it stopped
    +---------------------------------------+

A frame a pass and a longer one at the end; GIF or, by the suffix .png, APNG. The palette is one for all frames: the
file stays small.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from glyphs.atomic import check_writable, replacing
from glyphs.errors import FileError
from glyphs.surface.maps import EdgeMap, HeightMap
from recognition.active.active_reading import ActiveReading, PassFelt

SUFFIXES = (".gif", ".png")
FRAME_MS, LAST_MS = 450, 4000
_WIDTH_IN, _RIM_IN, _TITLE_IN, _BARS_IN, _DPI = 9.0, 0.25, 0.3, 1.35, 80
_COLOURS = 64
_STRONGEST_PERCENT = 99.0
_OLD, _NEW, _SURE, _DOUBT = "#8a5a00", "#ffd400", "#1a7346", "#d97800"


@dataclass(frozen=True, eq=False)
class FeltPart:
    """A part that was felt pass by pass.

    Attributes:
        height_map: its surface, dirt included.
        found: the reading, and the way to it.
        edges: what the whiskers had found after each pass; None where that was nothing yet.
        sure_from: confidence that a reading is accepted with.
    """

    height_map: HeightMap
    found: ActiveReading
    edges: Sequence[EdgeMap | None]
    sure_from: float

    def __post_init__(self) -> None:
        if len(self.edges) != len(self.found.passes) or not self.edges:
            raise ValueError(f"{len(self.edges)} edge maps for {len(self.found.passes)} passes")


def check_animation(path: Path) -> None:
    """Refuse, before the work starts, an animation that could not be written.

    Raises:
        FileError: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(path, "is not an animation that can be drawn", f"end it in {' or '.join(SUFFIXES)}")
    check_writable(path)


def save_animation(part: FeltPart, path: Path, *, still: Path | None = None) -> None:
    """Draw and write the animation; the file appears whole or not at all.

    Args:
        part: as it was felt.
        path: .gif or .png.
        still: for the last frame alone, .png; none unless given.

    Raises:
        FileError: it cannot be written.
    """
    check_animation(path)
    frames = list(_frames(part))
    # between them the middle and the last have every colour
    both = Image.new("RGB", (frames[0].width, 2 * frames[0].height))
    both.paste(frames[len(frames) // 2])
    both.paste(frames[-1], (0, frames[0].height))
    palette = both.quantize(_COLOURS)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    shown_ms = [FRAME_MS] * (len(drawn) - 1) + [LAST_MS]
    with replacing(path) as temporary:
        drawn[0].save(
            temporary,
            format="GIF" if path.suffix.lower() == ".gif" else "PNG",
            save_all=True,
            append_images=drawn[1:],
            duration=shown_ms,
            loop=0,
            optimize=True,
        )
    if still is not None:
        with replacing(still) as temporary:
            drawn[-1].save(temporary, format="PNG", optimize=True)


def _frames(part: FeltPart) -> Iterator[Image.Image]:
    for n in range(len(part.found.passes)):
        yield _drawn(_frame(part, n))


def _drawn(figure: Figure) -> Image.Image:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return Image.open(stream).convert("RGB")


def _frame(part: FeltPart, n: int) -> Figure:
    """After pass n, from 0."""
    passes = part.found.passes
    width, height = part.height_map.size_mm
    surface, felt, below = _panels(height / width)
    figure = surface.figure
    assert isinstance(figure, Figure)
    z = part.height_map.z_mm
    low, high = np.nanpercentile(z, (100.0 - _STRONGEST_PERCENT, _STRONGEST_PERCENT))
    _picture(surface, z, part.height_map.pitch_mm, (0.0, 0.0), cmap="gray", limits=(low, high))
    for k, one in enumerate(passes[: n + 1]):
        _lines(surface, one, last=k == n)
    surface.set_title(f"pass {n + 1}: {passes[n].why or 'lines felt'}", fontsize=10, loc="left")
    surface.set_title(
        f"{passes[n].stage_s:.1f} s of stage time", fontsize=11, loc="right", family="monospace"
    )
    _edges(felt, part.edges[n])
    felt.set_title("what the whiskers have felt", fontsize=10, loc="left")
    for axes in (surface, felt):
        axes.set(xlim=(0.0, width), ylim=(height, 0.0), xticks=(), yticks=(), xlabel="", ylabel="")
        axes.set_aspect("equal")
    last = n + 1 == len(passes)
    _beliefs(below, part, _believed(passes, n), width, stopped=part.found.stop.describe() if last else "")
    return figure


def _panels(aspect: float) -> list[Axes]:
    """Of a new figure, as wide as each other, so that bars stand under their characters."""
    inner = _WIDTH_IN - 2.0 * _RIM_IN
    heights = (inner * aspect, inner * aspect, _BARS_IN)
    whole = sum(heights) + len(heights) * _TITLE_IN + _RIM_IN
    figure, top, made = Figure(figsize=(_WIDTH_IN, whole)), whole, []
    for height in heights:
        top -= _TITLE_IN + height
        box = (_RIM_IN / _WIDTH_IN, top / whole, inner / _WIDTH_IN, height / whole)
        made.append(figure.add_axes(box))
    return made


def _lines(axes: Axes, one: PassFelt, *, last: bool) -> None:
    draw = axes.hlines if one.order.direction.along_x else axes.vlines
    draw(
        one.order.line_mm,
        *one.order.along_mm,
        colors=_NEW if last else _OLD,
        linewidth=1.6 if last else 0.7,
        alpha=1.0 if last else 0.55,
    )


def _edges(axes: Axes, edges: EdgeMap | None) -> None:
    axes.set_facecolor("#e1e1e1")
    if edges is None:
        return
    value = np.where(edges.valid, edges.enhancement.mean(axis=0), np.nan)
    top = max(float(np.nanpercentile(np.abs(value), _STRONGEST_PERCENT)), 1e-3)
    _picture(axes, value, edges.pitch_mm, edges.origin_mm, cmap="RdBu_r", limits=(-top, top))


def _picture(
    axes: Axes,
    values: NDArray[np.float32],
    pitch_mm: float,
    origin_mm: tuple[float, float],
    *,
    cmap: str,
    limits: tuple[float, float],
) -> None:
    (rows, cols), (x0, y0) = values.shape, origin_mm
    left, top = x0 - 0.5 * pitch_mm, y0 - 0.5 * pitch_mm
    box = (left, left + cols * pitch_mm, top + rows * pitch_mm, top)
    axes.imshow(values, extent=box, cmap=cmap, vmin=limits[0], vmax=limits[1], interpolation="nearest")


def _believed(passes: Sequence[PassFelt], n: int) -> PassFelt:
    """The latest pass after which somebody looked: several are felt before a look."""
    return next((p for p in reversed(passes[: n + 1]) if p.places), passes[n])


def _beliefs(axes: Axes, part: FeltPart, one: PassFelt, width_mm: float, *, stopped: str) -> None:
    axes.set(xlim=(0.0, width_mm), ylim=(-0.3, 1.62), xticks=(), yticks=())
    axes.spines[["top", "right", "left", "bottom"]].set_visible(False)
    axes.axhline(0.0, color="#56636f", linewidth=0.8)
    for k, place in enumerate(one.places):
        x = place.middle_mm[0]
        x = x if math.isfinite(x) else (k + 0.5) * width_mm / len(one.places)
        sure = place.probability >= part.sure_from
        colour = _SURE if sure else _DOUBT
        axes.bar(x, place.probability, width=0.05 * width_mm, color=colour, alpha=0.85)
        axes.text(
            x, 1.08, place.char, ha="center", va="bottom", fontsize=19, family="monospace", color=colour
        )
        if place.rival and not sure:
            axes.text(x, -0.27, f"or {place.rival}", ha="center", va="bottom", fontsize=8, color="#56636f")
    said = f"all right: {one.confidence:.3f}" if one.places else "nothing to be read yet"
    if stopped:
        reading = part.found.reading
        said = f"{reading.text}: {reading.confidence:.3f}. Stopped: {stopped}"
    axes.set_title(
        f"belief of each place; {said}", fontsize=10, loc="left", weight="bold" if stopped else "normal"
    )
