"""Lines that must be scanned before a text can be distinguished from its rivals.

    O or Q?     along x ------>  meets walls that run up and down       a wall shows only where a whisker crosses it:
                across  |        meets walls that run along the line    if all travels run along a tail, a bar or a
                        v                                               gap, it supports neither text

A place has a rival if the format allows another character that is easily confused with the one read, or that
is still probable. There, lines of both axes must lie close together from edge to edge of the character.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recognition.active.moves import Way
from recognition.decision.reading import Reading
from recognition.decision.stroke_doubts import add_stroke_findings
from recognition.language.box import Box
from whisker_array.estimation.edges import UNUSABLE
from whisker_array.scan.scan import Scan
from whisker_array.scan.sweep import Sweep

AXES = ((Way.ALONG, Way.BACK), (Way.CROSS, Way.CROSS_BACK))


@dataclass(frozen=True)
class LackingLines:
    """A place with too few scan lines to exclude its rivals.

    Attributes:
        place: index of the place, from 0.
        ways: directions, either of which adds the missing lines.
    """

    place: int
    ways: tuple[Way, ...]


def places_lacking_lines(
    reading: Reading, scan: Scan, *, widest_gap_heights: float = 0.3
) -> tuple[LackingLines, ...]:
    """Find places with rivals over which lines of an axis are missing.

    Args:
        reading: reading with the strokes of its rivals; if they are unknown, every place counts as having rivals.
        scan: all passes.
        widest_gap_heights: widest gap allowed between lines of an axis over a character, character heights: a little
            more than the quarter at which `JOINED` lays them. Of 180 dirty parts, two wrong serials were accepted from
            lines of one axis alone; neither was with a gap of 0.26 or 0.13.
    """
    strokes = reading.trace.strokes
    places = [k for k in range(len(reading.characters)) if not strokes or strokes[k].rivals]
    return tuple(
        LackingLines(k, ways)
        for k in places
        for ways in AXES
        if _gap_mm(scan, reading.characters[k].box, ways) > widest_gap_heights * reading.height_mm
    )


def review_lacking_lines(reading: Reading, scan: Scan) -> Reading:
    """Send an accepted reading to review if the felt lines do not distinguish it from its rivals."""
    missing = places_lacking_lines(reading, scan)
    if not missing or not reading.trace.strokes:
        return reading
    lacking = {one.place: _axis(one) for one in reversed(missing)}
    strokes = tuple(
        replace(place, too_few_lines=f"too few lines {lacking[k]} were felt over it")
        if k in lacking
        else place
        for k, place in enumerate(reading.trace.strokes)
    )
    return add_stroke_findings(reading.with_trace(strokes=strokes))


def _axis(one: LackingLines) -> str:
    return "along x" if one.ways[0].direction.along_x else "along y"


def _gap_mm(scan: Scan, box: Box, ways: Sequence[Way]) -> float:
    """Widest stretch across a box that no usable line of these ways crosses."""
    directions = [way.direction for way in ways]
    spans = ((box.x0_mm, box.x1_mm), (box.y0_mm, box.y1_mm))
    along, (low, high) = spans if directions[0].along_x else spans[::-1]
    sweeps = [s for s in scan.sweeps if s.plan.direction in directions and not s.plan.pushed]
    lines = np.concatenate([np.zeros(0), *(_usable_lines(s, along) for s in sweeps)])
    within = np.sort(lines[(lines >= low) & (lines <= high)])
    return float(np.diff(np.r_[low, within, high]).max())


def _usable_lines(sweep: Sweep, along_mm: tuple[float, float]) -> NDArray[np.float64]:
    """Positions of the lines that were felt over most of a stretch."""
    at = sweep.plan.position_mm()
    within = (at >= along_mm[0]) & (at <= along_mm[1])
    if not within.any():
        return np.zeros(0)
    usable = ((sweep.flags[:, :, within] & UNUSABLE) == 0).mean(axis=2) > 0.5
    return np.asarray(sweep.plan.line_mm[usable])
