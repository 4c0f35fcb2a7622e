"""Variants of a found line (moved, turned, lengthened), and default lines of a view."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from recognition.see.text_line import TextLine, moved_across, points_along
from recognition.see.view import View

SAGS = (-0.95, -0.5, 0.5, 0.95)
"""Sags by which a doubtful line is bent, character heights: under dirt the finder takes an arc for a straight line. On
89 photographs of arcs of the calibration design, dirt from 0.3 on, they raise characters from 66 to 74 %."""
LONGER = ((1.5, 1.5), (1.5, 0.0), (0.0, 1.5), (3.0, 0.0), (0.0, 3.0))
"""Character heights added before and after a doubtful line."""
CROPS = ((0.85, 0.5), (0.62, 0.5))
"""Lines of a view that is cropped to one line: height and middle, in view heights."""
BLIND = ((0.5, 0.5), (0.38, 0.5), (0.28, 0.5), (0.28, 0.3), (0.28, 0.7))
"""Fallback line positions when the finder fails: height and middle, in view heights."""


def move_line(line: TextLine, down: float, size: float, turn_deg: float = 0.0) -> TextLine:
    """Move a line down by a share of its height, scale its height, and turn it about its middle."""
    along = line.centre_mm[-1] - line.centre_mm[0]
    along = along / np.linalg.norm(along)
    moved = line.centre_mm + down * line.height_mm * np.array([-along[1], along[0]])
    if turn_deg:
        cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
        middle = 0.5 * (moved[0] + moved[-1])
        moved = middle + (moved - middle) @ np.array([[cos, sin], [-sin, cos]])
    return TextLine(moved, line.height_mm * size)


def anywhere(
    view: View, *, height_mm: float | None = None, blind_step: float = 0.6, most_blind: int = 10
) -> list[TextLine]:
    """Lines to try across a view in which none was found; their spacing is in character heights, if known."""
    if height_mm is None:
        return across(view, BLIND)
    share = height_mm / view.size_mm[1]
    if not 1.0 / most_blind < share <= 1.0:
        return []
    n = min(most_blind, math.ceil((1.0 - share) / (blind_step * share)) + 1)
    return across(view, [(share, middle) for middle in np.linspace(0.5 * share, 1.0 - 0.5 * share, n)])


def across(view: View, places: Sequence[tuple[float, float]]) -> list[TextLine]:
    """Lines across a view at heights and middles, in view heights; none of a view that is much taller than wide."""
    width, height = view.size_mm
    if width < 0.5 * height:
        return []
    x, y = view.origin_mm
    return [
        TextLine.straight(x, y + middle * height, length_mm=width, height_mm=share * height)
        for share, middle in places
    ]


def longer(line: TextLine) -> list[TextLine]:
    """Lengthen the line at either end or both: dirt hides characters from the finder."""
    return [lengthen(line, before, after) for before, after in LONGER]


def bend(line: TextLine, sag: float, *, points: int = 33) -> TextLine:
    """Bend a line to a parabola whose ends lie `sag` character heights lower than its middle."""
    shares = np.linspace(0.0, 1.0, points)
    down = sag * line.height_mm * ((2.0 * shares - 1.0) ** 2 - 1.0 / 3.0)
    return TextLine(moved_across(points_along(line, shares), down), line.height_mm)


def variants(line: TextLine) -> list[TextLine]:
    """A doubtful line moved, sized, turned and lengthened."""
    moves = ((0.0, 0.8), (0.0, 1.25), (0.2, 1.0), (-0.2, 1.0), (0.0, 1.0, 5.0), (0.0, 1.0, -5.0))
    return [*(move_line(line, *move) for move in moves), *longer(line)]


def is_same_place(
    line: TextLine,
    other: TextLine,
    *,
    most_across: float = 0.06,
    most_along: float = 0.25,
    most_size: float = 0.06,
) -> bool:
    """Whether two lines lie so near, in character heights, that the recogniser sees the same."""
    if abs(math.log(line.height_mm / other.height_mm)) > most_size:
        return False
    apart = (line.stations_mm - other.stations_mm) / line.height_mm
    along = other.centre_mm[-1] - other.centre_mm[0]
    along = along / np.linalg.norm(along)
    across = apart @ np.array([-along[1], along[0]])
    return bool(np.abs(across).max() < most_across and np.abs(apart @ along).max() < most_along)


def lengthen(line: TextLine, before: float, after: float) -> TextLine:
    """Extend a line straight beyond its ends, by a number of character heights."""
    points, height = line.centre_mm, line.height_mm
    first, last = points[0] - points[1], points[-1] - points[-2]
    pieces = [points]
    if before > 0.0:
        pieces.insert(0, (points[0] + before * height * first / np.linalg.norm(first))[None])
    if after > 0.0:
        pieces.append((points[-1] + after * height * last / np.linalg.norm(last))[None])
    return TextLine(np.concatenate(pieces), height)
