"""The passes of a part that was felt, for the picture of the lines and the list beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from pipeline.common.reading_records import PassRecord, ReadingRecord
from pipeline.service.pages.pictures import PictureView
from recognition.active.active_reading import StopReason

_SHARE, _THICKEST_MM = 0.35, 0.15
"""Share of the gap between lines that a drawn line covers, so that the picture shows between; and its most."""


@dataclass(frozen=True)
class Felt:
    """Felt passes of a part.

    Attributes:
        reading: reading made from the passes.
        stopped: why feeling stopped, in words; empty if unknown.
        picture: picture to draw the lines over; None without one of known scale.
        line_mm: thickness of a drawn line.
    """

    reading: ReadingRecord
    stopped: str
    picture: PictureView | None
    line_mm: float


def passes_view(readings: Sequence[ReadingRecord], pictures: Sequence[PictureView]) -> Felt | None:
    """The passes of the last reading that has any; None without one. Of the pictures the first that fits is used."""
    reading = next((r for r in reversed(readings) if r.passes), None)
    if reading is None:
        return None
    picture = next((p for p in pictures if p.href and p.frame is not None), None)
    known = reading.stopped in set(StopReason)
    stopped = StopReason(reading.stopped).message if known else reading.stopped
    return Felt(reading, stopped, picture, round(min(_THICKEST_MM, _SHARE * _gap_mm(reading.passes)), 4))


def _gap_mm(passes: Sequence[PassRecord]) -> float:
    """Median gap between neighbouring lines, of the direction whose lines lie closer."""
    gaps = []
    for ways in ((0, 180), (90, 270)):
        lines = sorted({v for p in passes if p.direction_deg in ways for v in p.line_mm})
        gaps += [median(b - a for a, b in pairwise(lines))] if len(lines) > 1 else []
    return min(gaps, default=1.0)
