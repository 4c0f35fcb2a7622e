"""Find lines of text in a view: a network runs at several scales, and its cells are joined to lines.

view --at several scales--> findings of cells --joined--> lines --best of those that overlap--> lines
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.surface.display import one_line
from recognition.recogniser.networks import open_network
from recognition.see.curves import arc_through, straight_through
from recognition.see.resample import resample, turn_back, turn_view
from recognition.see.text_line import TextLine, points_along
from recognition.see.view import HEIGHTS, View

WEIGHTS = Path(__file__).with_name("finder.onnx")
FINDER_ROWS, CELL = 12, 4
"""Pixels per character height that the network was trained on, and pixels per cell."""
_TALLEST, _LOW = 0.95, 0.13
"""Largest and smallest characters, shares of the view's smaller side; `recognition.find.tiles` finds smaller ones."""
_LEAST_PIXELS = 6.0
_MIDDLE, _FAINT = 0.5, 0.2
"""Least probability that a cell lies in the middle of a line; for faint lines."""
_GAP = 1.2
"""Longest stretch of land within a line, character heights."""
_LEAST_CELLS = 3
_INSIDE, _ALONG = np.linspace(0.05, 0.95, 15), np.linspace(0.0, 1.0, 61)
"""Shares of the lengths of two lines at which they are compared."""


@dataclass(frozen=True, eq=False)
class FoundLine:
    """A candidate line, and bent along an arc; the score counts cells by probability and area in square heights."""

    line: TextLine
    score: float
    bent: TextLine | None = None

    __repr__ = one_line

    def mapped(self, change: Callable[[TextLine], TextLine]) -> FoundLine:
        return replace(self, line=change(self.line), bent=self.bent and change(self.bent))


@dataclass(frozen=True, eq=False)
class Finder:
    """Finds the lines of a view; the network runs once at each scale of each rotation."""

    view: View
    height_mm: float | None = None
    _turned: dict[float, list[FoundLine]] = field(init=False, default_factory=dict)

    __repr__ = one_line

    def lines(self, *, faint: bool = False) -> list[FoundLine]:
        """Lines within some 30 degrees of level, most promising first; also faint ones."""
        least, origin_mm = _FAINT if faint else _MIDDLE, self.view.origin_mm
        candidates = [
            line
            for scale_mm, cells in self._cells.items()
            for line in joined_cells(cells, scale_mm / FINDER_ROWS, origin_mm, least=least)
        ]
        if self.height_mm is not None:
            candidates = [c.mapped(partial(_as_high, height_mm=self.height_mm)) for c in candidates]
        pieces = without_doubles(candidates)
        joined = (_join(*pair) for pair in combinations(pieces, 2))
        whole = [line for line in joined if line is not None]
        return sorted([*pieces, *whole], key=lambda line: -line.score)

    def turned(self, turned_deg: float) -> list[FoundLine]:

        def back(line: TextLine) -> TextLine:
            return TextLine(turn_back(line.centre_mm, self.view, turned_deg), line.height_mm)

        if turned_deg not in self._turned:
            turned = Finder(turn_view(self.view, turned_deg), self.height_mm).lines()
            self._turned[turned_deg] = [candidate.mapped(back) for candidate in turned]
        return self._turned[turned_deg]

    @cached_property
    def _cells(self) -> Mapping[float, NDArray[np.float32]]:
        return {scale_mm: _cells_at(self.view, scale_mm) for scale_mm in _scales(self.view, self.height_mm)}


def _as_high(line: TextLine, height_mm: float, *, nominal: float = 1.08) -> TextLine:
    return TextLine(line.centre_mm, float(np.clip(line.height_mm, height_mm / nominal, height_mm * nominal)))


def _join(
    piece: FoundLine,
    other: FoundLine,
    *,
    alike: float = 0.25,
    parallel_deg: float = 10.0,
    level: float = 0.4,
    broken: float = 6.0,
) -> FoundLine | None:
    a, b = piece.line, other.line
    height = 0.5 * (a.height_mm + b.height_mm)
    if abs(math.log(a.height_mm / b.height_mm)) > alike or abs(a.turned_deg - b.turned_deg) > parallel_deg:
        return None
    along = (a if a.length_mm > b.length_mm else b).centre_mm
    along = (along[-1] - along[0]) / np.linalg.norm(along[-1] - along[0])
    ends = np.concatenate([a.centre_mm[[0, -1]], b.centre_mm[[0, -1]]])
    u, v = ends @ along, ends @ np.array([-along[1], along[0]])
    gap = max(u[2] - u[1], u[0] - u[3])
    if gap > broken * height or abs(v[:2].mean() - v[2:].mean()) > level * height:
        return None
    straight = straight_through(ends[np.argsort(u)], before=0.0, after=0.0)
    return FoundLine(TextLine(straight, height), piece.score + other.score)


def _scales(view: View, height_mm: float | None, *, octaves: float = 0.7) -> list[float]:
    # octaves: octaves between two scales
    if height_mm is not None:
        return [height_mm * 2.0 ** (-octaves * k) for k in (1.0, 0.5, 0.0)]
    side = min(view.size_mm)
    least = _LEAST_PIXELS * view.pitch_mm
    low, high = (max(share * side, least) for share in (_LOW, _TALLEST))
    count = max(1, math.ceil(math.log2(high / low) / octaves))
    return [high * 2.0 ** (-octaves * (k + 0.5)) for k in range(count)]


def _cells_at(view: View, scale_mm: float) -> NDArray[np.float32]:
    layers = resample(view, scale_mm / FINDER_ROWS)
    layers[HEIGHTS] /= scale_mm
    rows, columns = layers.shape[1:]
    fed = np.pad(layers, ((0, 0), (0, -rows % CELL), (0, -columns % CELL)))
    cells: NDArray[np.float32] = findings(fed[None])[0]
    return cells


def findings(views: NDArray[np.float32]) -> NDArray[np.float32]:
    """Run the finder on (n, LAYERS, rows, columns), whole cells: (n, FINDINGS, rows / CELL, columns / CELL)."""
    cells: NDArray[np.float32] = _session().run(None, {"view": views})[0]
    return cells


def joined_cells(
    cells: NDArray[np.float32], pitch_mm: float, origin_mm: tuple[float, float], *, least: float
) -> list[FoundLine]:
    """Join (FINDINGS, rows, columns) of cells to lines; from `least` a cell is the middle of a line."""
    belief = 1.0 / (1.0 + np.exp(-cells[0]))
    # join the words of a line: cells up to a gap apart
    reach = max(1, round(_GAP * FINDER_ROWS / CELL / 2))
    joined = ndimage.binary_dilation(belief > least, np.ones((1, 2 * reach + 1), dtype=bool))
    labels, count = ndimage.label(joined, np.ones((3, 3)))
    lines = []
    for label in range(1, count + 1):
        v, u = np.nonzero((labels == label) & (belief > least))
        if u.size >= _LEAST_CELLS:
            lines.append(_line(u, v, cells[:, v, u], belief[v, u], pitch_mm, origin_mm))
    return lines


def without_doubles(candidates: Sequence[FoundLine]) -> list[FoundLine]:
    """Lines without duplicates found at another scale, most promising first."""
    lines: list[FoundLine] = []
    for candidate in sorted(candidates, key=lambda candidate: -candidate.score):
        if not any(overlap(candidate.line, other.line) for other in lines):
            lines.append(candidate)
    return lines


def _line(
    u: NDArray[np.intp], v: NDArray[np.intp], cells: NDArray[np.float32], belief: NDArray[np.float32],
    pitch_mm: float, origin_mm: tuple[float, float],
) -> FoundLine:  # fmt: skip
    height_mm = float(FINDER_ROWS * pitch_mm * 2.0 ** np.median(cells[1]))
    turned = float(np.median(cells[2]))
    down = cells[3] * height_mm
    x = (u * CELL + CELL / 2 - 0.5) * pitch_mm + origin_mm[0] - down * math.sin(turned)
    y = (v * CELL + CELL / 2 - 0.5) * pitch_mm + origin_mm[1] + down * math.cos(turned)
    along = x * math.cos(turned) + y * math.sin(turned)
    order = np.argsort(along)
    # one point per cell length along the line: the weighted mean of its cells
    bins = ((along[order] - along[order[0]]) / (CELL * pitch_mm)).astype(np.intp)
    weight = np.bincount(bins, belief[order])
    filled = weight > 0.0
    points = np.stack(
        [np.bincount(bins, (values * belief)[order])[filled] / weight[filled] for values in (x, y)], axis=1
    )
    half = CELL * pitch_mm / 2
    straight = TextLine(straight_through(points, before=half, after=half), height_mm)
    arc = arc_through(points, height=height_mm, before=half, after=half)
    score = float(belief.sum()) * (CELL * pitch_mm / height_mm) ** 2
    return FoundLine(straight, score, None if arc is None else TextLine(arc, height_mm))


def overlap(line: TextLine, other: TextLine, *, band_mm: float | None = None) -> bool:
    """Whether two lines are the same ink: half of the first lies within `band_mm` of the other's middle."""
    band_mm = 0.6 * max(line.height_mm, other.height_mm) if band_mm is None else band_mm
    # no point of a curve is further than half its length from the middle between its ends
    if math.hypot(*(line.middle_mm - other.middle_mm)) > 0.5 * (line.length_mm + other.length_mm) + band_mm:
        return False
    points, curve = points_along(line, _INSIDE), points_along(other, _ALONG)
    far = np.linalg.norm(points[:, None] - curve, axis=2)
    nearest = far.argmin(axis=1)
    inside = (far.min(axis=1) < band_mm) & (nearest > 0) & (nearest < len(curve) - 1)
    return bool(inside.mean() > 0.5)


@cache
def _session() -> Any:
    return open_network(WEIGHTS)
