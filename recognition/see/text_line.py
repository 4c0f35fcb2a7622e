"""Position of a line of text on a part: along a curve, because serials also run around badges and shafts.

   .--- A  B  C ---.           centre_mm: points of the curve half way up the characters
.-'    ^ height_mm  '-.        in the order of reading; down is 90 degrees clockwise from along
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line

Points = NDArray[np.float64]

ROWS = 40
"""Rows of a strip."""
HEIGHT_ROWS = 28
"""Rows of a strip per character height."""
MARGIN = 0.4
"""Margin of land in a strip before and after its line, character heights."""


@dataclass(frozen=True, eq=False)
class TextLine:
    """A line of text. Raises ValueError.

    `centre_mm` is (n >= 2, 2) x, y in the frame of the view, from the first character's left edge to the last's right.
    """

    centre_mm: Points
    height_mm: float

    __repr__ = one_line

    def __post_init__(self) -> None:
        points = np.array(self.centre_mm, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or points.shape[0] < 2 or not np.isfinite(points).all():
            raise ValueError(
                f"the centre of a line is {points.shape}: (n, 2) finite points are needed, two at least"
            )
        if not (math.isfinite(self.height_mm) and self.height_mm > 0.0):
            raise ValueError(f"height_mm is {self.height_mm}; a character height is a positive number of mm")
        if np.linalg.norm(np.diff(points, axis=0), axis=1).sum() <= 0.0:
            raise ValueError("the centre of a line has no length")
        points.flags.writeable = False
        object.__setattr__(self, "centre_mm", points)

    @classmethod
    def straight(
        cls, x_mm: float, y_mm: float, *, length_mm: float, height_mm: float, turned_deg: float = 0.0
    ) -> TextLine:
        """A straight line that starts at x, y (half way up), turned from +x towards +y (clockwise as seen)."""
        turn = math.radians(turned_deg)
        end = (x_mm + length_mm * math.cos(turn), y_mm + length_mm * math.sin(turn))
        return cls(np.array([(x_mm, y_mm), end]), height_mm)

    @cached_property
    def length_mm(self) -> float:
        """Length along the curve."""
        return float(np.linalg.norm(np.diff(self.centre_mm, axis=0), axis=1).sum())

    @cached_property
    def middle_mm(self) -> Points:
        """(2,) x, y half way between its ends."""
        return np.asarray(self.centre_mm[[0, -1]].mean(axis=0))

    @cached_property
    def stations_mm(self) -> Points:
        """(3, 2) x, y of the start, middle and end of its curve."""
        return points_along(self, np.array([0.0, 0.5, 1.0]))

    @property
    def turned_deg(self) -> float:
        """Rotation of the line from its start to its end, from +x towards +y."""
        across, down = self.centre_mm[-1] - self.centre_mm[0]
        return math.degrees(math.atan2(down, across))

    @property
    def reversed(self) -> TextLine:
        """The line in the other direction, for a part that lies upside down."""
        return TextLine(self.centre_mm[::-1], self.height_mm)

    def columns(self, *, margin: float = MARGIN) -> int:
        """Return the number of columns of its strip."""
        return max(8, math.ceil((self.length_mm / self.height_mm + 2 * margin) * HEIGHT_ROWS))

    def places_mm(
        self, columns: Points, rows: Points | float, *, margin: float = MARGIN, of_rows: float = ROWS
    ) -> Points:
        """(..., 2) x, y of points of its strip, at columns and rows counted from the middle of the first pixel."""
        on, down = self._frames(columns, margin)
        far = (np.asarray(rows, dtype=np.float64) + 0.5 - of_rows / 2) * (self.height_mm / HEIGHT_ROWS)
        return np.asarray(on + far[..., None] * down)

    def _frames(self, columns: Points, margin: float) -> tuple[Points, Points]:
        along = (
            np.asarray(columns, dtype=np.float64) + 0.5
        ) * self.height_mm / HEIGHT_ROWS - margin * self.height_mm
        pieces = np.diff(self.centre_mm, axis=0)
        lengths = np.linalg.norm(pieces, axis=1)
        some = lengths > 0.0
        points, pieces, lengths = self.centre_mm[:-1][some], pieces[some], lengths[some]
        starts = np.concatenate([[0.0], np.cumsum(lengths[:-1])])
        piece = np.searchsorted(starts[1:], along, side="right")
        on = points[piece] + (pieces[piece] / lengths[piece, None]) * (along - starts[piece])[..., None]
        # the direction turns evenly from the middle of a piece to the middle of the next
        angles = np.arctan2(pieces[:, 1], pieces[:, 0])
        turn = np.interp(along, starts + lengths / 2, np.unwrap(angles) if angles.size > 1 else angles)
        return on, np.stack([-np.sin(turn), np.cos(turn)], axis=-1)


def points_along(line: TextLine, shares: Points) -> Points:
    """(n, 2) x, y of points of a line's curve, at shares of its length."""
    points = line.centre_mm
    lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    return np.stack([np.interp(shares * lengths[-1], lengths, points[:, k]) for k in (0, 1)], axis=1)


def moved_across(points: Points, down_mm: Points) -> Points:
    """(n, 2) points of a curve, each moved down by its own distance, at right angles to the curve."""
    ahead = np.gradient(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    return np.asarray(points + down_mm[:, None] * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1))
