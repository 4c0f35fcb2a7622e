"""Lines that must be scanned before a text can be distinguished from its rivals.

    O or Q?     along x ------>  meets walls that run up and down       a wall shows only where a whisker crosses it:
                across  |        meets walls that run along the line    if all travels run along a tail, a bar or a
                        v                                               gap, it supports neither text

At a place with a rival, lines of both axes must lie close together from edge to edge of the character.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.language.box import Box
from recognition.marks.strokes import PlaceStrokes
from whisker_array.estimation.edges import UNUSABLE
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep


@dataclass(frozen=True)
class LackingLines:
    """A place with too few scan lines, along x or else along y, to exclude its rivals."""

    place: int
    along_x: bool

    @property
    def axis(self) -> str:
        return "along x" if self.along_x else "along y"


def places_lacking_lines(
    scan: Scan,
    boxes: Sequence[Box],
    strokes: Sequence[PlaceStrokes],
    *,
    height_mm: float,
    # widest gap allowed between lines of an axis over a character, character heights: a little more than the
    # quarter at which active touch lays them. Of 180 dirty parts, two wrong serials were accepted from lines
    # of one axis alone; neither was with a gap of 0.26 or 0.13.
    widest_gap_heights: float = 0.3,
) -> tuple[LackingLines, ...]:
    """Find places with rivals, or unknown ones, over which lines of an axis are missing."""
    return tuple(
        LackingLines(k, along_x)
        for k, box in enumerate(boxes)
        if not strokes or strokes[k].rivals
        for along_x in (True, False)
        if _gap_mm(scan, box, along_x=along_x) > widest_gap_heights * height_mm
    )


def _gap_mm(scan: Scan, box: Box, *, along_x: bool) -> float:
    spans = ((box.x0_mm, box.x1_mm), (box.y0_mm, box.y1_mm))
    along, (low, high) = spans if along_x else spans[::-1]
    sweeps = [s for s in scan.sweeps if s.plan.direction.along_x == along_x and not s.plan.pushed]
    lines = np.concatenate([np.zeros(0), *(_usable_lines(s, along) for s in sweeps)])
    within = np.sort(lines[(lines >= low) & (lines <= high)])
    return float(np.diff(np.r_[low, within, high]).max())


def _usable_lines(sweep: Sweep, along_mm: tuple[float, float]) -> NDArray[np.float64]:
    position_mm = sweep.plan.position_mm()
    within = (position_mm >= along_mm[0]) & (position_mm <= along_mm[1])
    if not within.any():
        return np.zeros(0)
    usable = ((sweep.flags[:, :, within] & UNUSABLE) == 0).mean(axis=2) > 0.5
    return np.asarray(sweep.plan.line_mm[usable])
