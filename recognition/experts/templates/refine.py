"""Every candidate in the same cell, at the scan's full resolution.

All candidates of a place answer for the same *cell*, from halfway to the one neighbour to halfway to the other, over
small shifts and rotations: one product (shifts x pixels) (pixels x templates) a cell, see `cell_scores`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from recognition.experts.templates.cell_scores import CellInk, cell_ink, straight_scores, tilted_score
from recognition.experts.templates.frames import LineImage, channels, resampled
from recognition.experts.templates.placed_line import PlacedLine
from recognition.experts.templates.predicted import PIXELS, TemplateSet

SHIFT_ROWS = 3
SHIFT_COLUMNS = 7
"""Shifts tried: a stem may lie far from the middle of the ink, as in a 1 with a long flag."""
HEIGHT_FACTORS = ((0.978, 0.955), (1.022, 1.045))
"""Heights tried about the one found, smaller and larger, each way as far as it helps."""
TURNS_DEG = (-3.0, 3.0)
INK_SHARE, INK_REACH_HEIGHTS = 0.2, 0.35
"""Of the strongest column, what counts as ink; how far its middle may lie from the one placed, heights."""
LEADERS, TURNED_LEADERS = 5, 2
"""Candidates that are tried leaning as well, and of these the ones tried turned."""
MAX_LEAN = 0.5
"""Depth gained or lost at the edge of a leaning character, at most, as a share of its depth."""
CELL_ROWS_HEIGHTS = 0.58
"""Half height of a cell, in character heights."""
MAX_SIDE_HEIGHTS = 0.35
"""Land beside the placed character's ink that a cell takes in, at most."""


@dataclass(frozen=True, eq=False)
class Cell:
    """Scores of one place.

    Attributes:
        scores: (T,) best correlation of each template in this cell.
        u_mm, v_mm: where the best template's reference point lies, line frame.
        turn_deg: its turn against the line.
        half_width_mm: half the ink width of the best template.
    """

    scores: NDArray[np.float64]
    u_mm: float
    v_mm: float
    turn_deg: float
    half_width_mm: float


def fine_templates(
    templates: TemplateSet, directions: tuple[TraceDirection, ...]
) -> dict[float, NDArray[np.float32]]:
    """(T, channels, rows, cols) of the set, straight and turned; kept in the set's work space."""
    kept = templates.work.get("fine")
    if isinstance(kept, dict):
        return kept
    from scipy import ndimage

    straight = channels(templates.patches, directions, axis=1)
    made = {0.0: straight}
    for turn in TURNS_DEG:
        # positive turns from +u to +v, clockwise as seen; ndimage.rotate turns the other way
        made[turn] = ndimage.rotate(straight, -turn, axes=(3, 2), reshape=False, order=1, mode="constant")
    templates.work["fine"] = made
    return made


def refine_line(
    line: PlacedLine, directions: tuple[TraceDirection, ...]
) -> tuple[PlacedLine, tuple[Cell, ...]]:
    """Settle the height on the characters believed, then score every template in every cell.

    Args:
        line: characters where they are believed to stand, at the edge map's own pitch.
        directions: of the edge map.

    Returns:
        The line with its height settled, and a cell a character.
    """
    made = _inks(line.templates, directions)
    cells = _score_line(line, made)
    winners = [int(np.argmax(c.scores)) for c in cells]
    found = list(zip(winners, cells, strict=True))
    best, best_mean = line, float(np.mean([c.scores[0] for c in _score_line(line, made, only=found)]))
    for way in HEIGHT_FACTORS:
        for factor in way:
            varied = replace(line, height_mm=line.height_mm * factor)
            mean = float(np.mean([c.scores[0] for c in _score_line(varied, made, only=found)]))
            if mean <= best_mean + 1e-4:
                break
            best, best_mean = varied, mean
        if best is not line:
            break
    return best, cells if best is line else _score_line(best, made)


def guessed_cells(line: PlacedLine, directions: tuple[TraceDirection, ...]) -> tuple[Cell, ...]:
    """The characters believed, near where they are believed to stand; other templates score -1."""
    at = [
        (int(t), Cell(np.zeros(0), float(u), float(v), 0.0, 0.0))
        for t, u, v in zip(line.template, line.u_mm, line.v_mm, strict=True)
    ]
    cells = []
    for (t, _), cell in zip(at, _score_line(line, _inks(line.templates, directions), only=at), strict=True):
        scores = np.full(len(line.templates.chars), -1.0)
        scores[t] = cell.scores[0]
        cells.append(replace(cell, scores=scores))
    return tuple(cells)


def _score_line(
    line: PlacedLine,
    made: dict[float, CellInk],
    *,
    only: list[tuple[int, Cell]] | None = None,
) -> tuple[Cell, ...]:
    """All templates in every cell, or in each cell only the one named, about where it stood before."""
    height, templates, u_mm, v_mm = line.height_mm, line.templates, line.u_mm.tolist(), line.v_mm.tolist()
    pixel = height / PIXELS
    fine = resampled(line.image, pitch_u_mm=pixel, pitch_v_mm=pixel)
    u0, v0 = fine.origin_mm
    up = _cell_rows(templates)
    half = [float(w) * height for w in templates.half_width[line.template]]
    cells = []
    for i in range(len(u_mm)):
        side = MAX_SIDE_HEIGHTS * height
        left = right = half[i] + side
        if i > 0:
            left = min(left, half[i] + 0.5 * (u_mm[i] - half[i] - u_mm[i - 1] - half[i - 1]))
        if i + 1 < len(u_mm):
            right = min(right, half[i] + 0.5 * (u_mm[i + 1] - half[i + 1] - u_mm[i] - half[i]))
        u, v = (u_mm[i], v_mm[i]) if only is None else (only[i][1].u_mm, only[i][1].v_mm)
        middle, row = (u - u0) / fine.pitch_u_mm, round((v - v0) / pixel)
        low, high = (u_mm[i] - left - u0) / fine.pitch_u_mm, (u_mm[i] + right - u0) / fine.pitch_u_mm
        anchors = [middle]
        if only is None:
            inked = _ink_middle(fine, row, low, high, middle)
            if abs(inked - middle) > SHIFT_COLUMNS / 2:
                anchors.append(inked)
        seen = [
            _score_cell(
                fine,
                made,
                templates.half_width,
                only=None if only is None else only[i][0],
                column=round(anchor),
                row=row,
                left=max(4, round(anchor - low)),
                right=max(4, round(high - anchor)),
                up=up,
            )
            for anchor in anchors
        ]
        leader = max(seen, key=lambda c: float(c.scores.max()))
        cells.append(replace(leader, scores=np.max([c.scores for c in seen], axis=0)))
    return tuple(cells)


def _inks(templates: TemplateSet, directions: tuple[TraceDirection, ...]) -> dict[float, CellInk]:
    """Ink of the templates, straight and turned; kept in the set's work space."""
    kept = templates.work.get("cell ink")
    if isinstance(kept, dict):
        return kept
    fine = fine_templates(templates, directions)
    strength = np.abs(fine[0.0]).max(axis=(0, 1, 3))
    inked = np.flatnonzero(strength > INK_SHARE * strength.max())
    middle = strength.size // 2
    # hooks below the line belong to the cell
    reach = int(max(middle - inked[0], inked[-1] - middle)) + 1
    up = min(middle, max(math.ceil(CELL_ROWS_HEIGHTS * PIXELS), reach))
    made = {turn: cell_ink(patches, up) for turn, patches in fine.items()}
    templates.work["cell ink"], templates.work["cell rows"] = made, up
    return made


def _cell_rows(templates: TemplateSet) -> int:
    """Half height of the set's cells, pixels."""
    up = templates.work["cell rows"]
    assert isinstance(up, int)
    return up


def _ink_middle(fine: LineImage, row: int, low: float, high: float, placed: float) -> float:
    """Middle column of what is felt between two columns: where the right template's reference point should lie.

    The search may have placed a wrong template, whose stem lies elsewhere in its ink than the right one's; and
    faint ink may not be felt, so the place found by the search is kept as well.
    """
    half = PIXELS // 2
    first, last = max(0, round(low)), min(fine.channels.shape[2], round(high) + 1)
    if last - first < 4:
        return placed
    band = fine.channels[:, max(0, row - half) : row + half + 1, first:last]
    felt = np.sqrt((band.astype(np.float64) ** 2).sum(axis=(0, 1)))
    inked = np.flatnonzero(felt > INK_SHARE * felt.max())
    if inked.size == 0:
        return placed
    middle = first + 0.5 * float(inked[0] + inked[-1])
    return middle if abs(middle - placed) < INK_REACH_HEIGHTS * PIXELS else placed


def _score_cell(
    fine: LineImage,
    made: dict[float, CellInk],
    half_width: NDArray[np.float64],
    *,
    only: int | None,
    column: int,
    row: int,
    left: int,
    right: int,
    up: int,
) -> Cell:
    ink = made[0.0]
    middle = ink.start.shape[1] // 2 - 1
    left, right = min(left, middle), min(right, middle)
    sv, su = (SHIFT_ROWS, SHIFT_COLUMNS) if only is None else (1, 1)
    first, last = (0, ink.start.shape[0]) if only is None else (only, only + 1)
    cell = (row, column, up, left, right, sv, su)
    straight = straight_scores(fine.channels, ink, first, last, cell)
    scores, shift = straight.best, straight.shift
    turn = np.zeros(scores.size)
    if only is None:
        for angle in (0.0, *TURNS_DEG):
            for t in np.argsort(-scores)[: LEADERS if angle == 0.0 else TURNED_LEADERS]:
                # the die of a hammer blow leans: depth varies over the character as 1 + a u + b v
                half = max(float(half_width[t]) * PIXELS, 1.0)
                score, at = tilted_score(
                    straight, 2 * su + 1, made[angle], t,
                    up=up, left=left, right=right, half_width=half, half_height=0.5 * PIXELS, most_lean=MAX_LEAN,
                )  # fmt: skip
                if score > scores[t]:
                    scores[t], shift[t], turn[t] = score, at, angle
    winner = int(np.argmax(scores))
    dv, du = divmod(int(shift[winner]), 2 * su + 1)
    u0, v0 = fine.origin_mm
    return Cell(
        scores=scores,
        u_mm=u0 + (column + du - su) * fine.pitch_u_mm,
        v_mm=v0 + (row + dv - sv) * fine.pitch_v_mm,
        turn_deg=float(turn[winner]),
        half_width_mm=float(half_width[first + winner]) * PIXELS * fine.pitch_u_mm,
    )
