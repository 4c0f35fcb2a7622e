"""Active touch as an animation: lines felt one pass after the other, the confidence, the stop.

    +---------------------------------------+
    |  the part, lines felt; the last bright |   above: the surface under the whiskers
    +---------------------------------------+
    |  the edge map of the lines so far      |   middle
    +---------------------------------------+
    |  confidence of the text read so far    |   below, over stage time; why it stopped
    +---------------------------------------+

A frame a pass and a longer one at the end. One palette for all frames keeps the file small.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from glyphs.soiling.soiled import Soiling
from glyphs.surface.maps import EdgeMap, HeightMap, MapError
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.plots.pictures import styled
from recognition.active.active_reader import scan_of
from recognition.active.active_reading import ActiveReading
from recognition.active.felt_log import read_and_log
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.see.levelling import level
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from whisker_array.estimation.edges import edge_map

FORMAT, SEED, NUMBER, BUDGET_S = "AA999999", 11, 2, 60.0
FRAME_MS, LAST_MS = 450, 4000
_WIDTH_IN, _BARS_IN, _DPI, _COLOURS = 9.0, 1.35, 80, 64
_STRONGEST_PERCENT = 99.0
_OLD, _NEW, _NEWEST, _QUIET = "#8a5a00", "#ffd400", "#1a7346", "#56636f"


@dataclass(frozen=True, eq=False)
class FeltPart:
    """A part that was felt pass by pass.

    Attributes:
        height_map: its surface, dirt included.
        found: the reading, and the way to it.
        edges: the edge map after each pass; None while there is none yet.
        sure_from: confidence that a reading is accepted with.
    """

    height_map: HeightMap
    found: ActiveReading
    edges: Sequence[EdgeMap | None]
    sure_from: float


def draw_active_touch(path: Path) -> None:
    """Feel a dirty part pass by pass, and write the animation as GIF."""
    part = _feel()
    frames = [_frame(part, n) for n in range(len(part.found.passes))]
    # between them the middle and the last have every colour
    both = np.concatenate([np.asarray(frames[len(frames) // 2]), np.asarray(frames[-1])])
    palette = Image.fromarray(both).quantize(_COLOURS)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    shown_ms = [FRAME_MS] * len(others) + [LAST_MS]
    first.save(path, save_all=True, append_images=others, duration=shown_ms, loop=0, optimize=True)


def _feel() -> FeltPart:
    spec = SynthSpec(FORMAT, seed=SEED, height_mm=5.0, soiling=Soiling(severity=0.5))
    part, height_mm = make_part(spec, NUMBER), spec.height_mm
    reader = Reader(format=FORMAT, fonts=(spec.font,), height_mm=height_mm, orientation=Orientation.UPRIGHT)
    session = VirtualBench(part.height_map, height_mm, VirtualArray(seed=SEED), part.soil).open_session()
    try:
        found = read_and_log(reader.touch, session, budget_s=BUDGET_S)
    finally:
        session.close()
    assert found.scan is not None
    assert found.scan.log is not None
    sweeps = [p.sweep for p in found.scan.log.passes]

    def edges(passes: int) -> EdgeMap | None:
        try:
            return edge_map(scan_of(session.fitting, sweeps[:passes]))
        except MapError:
            return None

    return FeltPart(
        level(part.height_map),
        found,
        [edges(k + 1) for k in range(len(sweeps))],
        sure_from=reader.settings.least_score("tactile"),
    )


@styled
def _frame(part: FeltPart, n: int) -> Image.Image:
    """Draw the state after pass n, from 0."""
    passes, ends_s = part.found.passes, part.found.ends_s
    width, height = part.height_map.size_mm
    heights = (height / width, height / width, _BARS_IN / _WIDTH_IN)
    figure = Figure(figsize=(_WIDTH_IN, _WIDTH_IN * sum(heights) + 1.2))
    surface, felt, below = figure.subplots(3, 1, height_ratios=heights)
    z = part.height_map.z_mm
    limits = np.nanpercentile(z, (100.0 - _STRONGEST_PERCENT, _STRONGEST_PERCENT)).tolist()
    _image(surface, z, part.height_map.pitch_mm, (0.0, 0.0), cmap="gray", limits=limits)
    for one in passes[: n + 1]:
        draw = surface.hlines if one.order.direction.along_x else surface.vlines
        new = one is passes[n]
        shown = (
            {"colors": _NEW, "linewidth": 1.6} if new else {"colors": _OLD, "linewidth": 0.7, "alpha": 0.55}
        )
        draw(one.order.line_mm, *one.order.along_mm, **shown)
    surface.set_title(f"pass {n + 1}: {passes[n].why or 'lines felt'}")
    surface.set_title(f"{ends_s[n]:.1f} s of stage time", loc="right", family="monospace")
    felt.set_facecolor("#e1e1e1")
    felt.set_title("felt by the whiskers")
    edges = part.edges[n]
    if edges is not None:
        value = np.where(edges.valid, edges.enhancement.mean(axis=0), np.nan)
        top = max(float(np.nanpercentile(np.abs(value), _STRONGEST_PERCENT)), 1e-3)
        _image(felt, value, edges.pitch_mm, edges.origin_mm, cmap="RdBu_r", limits=(-top, top))
    for axes in (surface, felt):
        axes.set(xlim=(0.0, width), ylim=(height, 0.0), xticks=(), yticks=(), aspect="auto")
    looked = [k for k, one in enumerate(passes[: n + 1]) if one.text]
    looks = [passes[k] for k in looked]
    below.plot([ends_s[k] for k in looked], [one.confidence for one in looks], "o-", color=_NEWEST)
    below.axhline(part.sure_from, color=_QUIET, linewidth=0.8, linestyle="--")
    below.set(
        xlim=(0.0, 1.05 * ends_s[-1]), ylim=(0.0, 1.1), xlabel="seconds of stage time",
        ylabel="confidence",
    )  # fmt: skip
    title = f"{looks[-1].text}: {looks[-1].confidence:.3f}" if looks else "nothing to be read yet"
    if last := n + 1 == len(passes):
        reading = part.found.reading
        title = f"{reading.text}: {reading.confidence:.3f}. Stopped: {part.found.stop.message}"
    below.set_title(title, weight="bold" if last else "normal")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return Image.open(stream).convert("RGB")


def _image(
    axes: Axes,
    values: NDArray[np.float32],
    pitch_mm: float,
    origin_mm: tuple[float, float],
    *,
    cmap: str,
    limits: Sequence[float],
) -> None:
    (rows, cols), left, top = values.shape, origin_mm[0] - 0.5 * pitch_mm, origin_mm[1] - 0.5 * pitch_mm
    box = (left, left + cols * pitch_mm, top + rows * pitch_mm, top)
    axes.imshow(values, extent=box, cmap=cmap, vmin=limits[0], vmax=limits[1], interpolation="nearest")
