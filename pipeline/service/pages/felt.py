"""What was felt of a part pass by pass, over the picture of touch, and why feeling stopped.

    passes in mm of the reading's frame --the picture's frame--> a path of lines each, in pixels

Lines take their colour from their turn: the first are dark, the last are bright.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from pipeline.common.reading_records import PassRecord, ReadingRecord
from pipeline.service.pages.pictures import PictureView
from recognition.active.active_reading import StopReason

ARROWS = {0: "→", 90: "↓", 180: "←", 270: "↑"}
_COLOURS = ((38, 26, 110), (122, 32, 130), (200, 62, 90), (238, 120, 40), (240, 180, 20))
"""From the first pass to the last; apart from each other in lightness too."""
_SHARE, _THICKEST_MM = 0.35, 0.15
"""Of the gap between lines, what a line covers; and how thick it is drawn at most."""


@dataclass(frozen=True)
class PassView:
    """A pass as the page shows it.

    Attributes:
        number: from 1.
        arrow: the way the whiskers were dragged.
        lines: how many.
        colour: as SVG has it.
        path: of its lines on the picture, as SVG has it; empty where there is no picture.
        took_s: stage seconds.
        at_s: stage seconds up to its end.
        text: what was believed after it; empty where nobody asked.
        confidence: that all of it is right.
        why: what it was chosen for.
        preload_mm: how far below the land the free tip ran.
        harder: whether it was pressed on harder than the first one.
    """

    number: int
    arrow: str
    lines: int
    colour: str
    path: str
    took_s: float
    at_s: float
    text: str
    confidence: float
    why: str
    preload_mm: float
    harder: bool


@dataclass(frozen=True)
class FeltView:
    """All passes of a part.

    Attributes:
        passes: in the order in which they were felt.
        stage_s: they took together.
        stopped: why there are no more, in words; empty where nobody said.
        picture: under the lines; None without any.
        width: of a line on the picture, pixels: much less than lines lie apart, so that the picture shows between.
    """

    passes: tuple[PassView, ...]
    stage_s: float
    stopped: str
    picture: PictureView | None
    width: float


def felt_view(readings: Sequence[ReadingRecord], pictures: Sequence[PictureView]) -> FeltView | None:
    """What was felt for the last reading that passes were felt for; None where none were.

    Args:
        readings: of the part, the last one last.
        pictures: that show the part, the best one first; those of an unknown scale are of no use.
    """
    reading = next((r for r in reversed(readings) if r.passes), None)
    if reading is None:
        return None
    picture = next((p for p in pictures if p.href and p.frame is not None), None)
    ends = [p.stage_s for p in reading.passes]
    begins = [0.0, *ends[:-1]]
    n, usual_mm = len(ends), reading.passes[0].preload_mm
    passes = tuple(
        PassView(
            number=k + 1,
            arrow=ARROWS.get(one.direction_deg, ""),
            lines=len(one.line_mm),
            colour=_colour(k / max(1, n - 1)),
            path="" if picture is None else _path(one, picture),
            took_s=one.stage_s - began,
            at_s=one.stage_s,
            text=one.text,
            confidence=one.confidence,
            why=one.why,
            preload_mm=one.preload_mm,
            harder=one.preload_mm > usual_mm,
        )
        for k, (one, began) in enumerate(zip(reading.passes, begins, strict=True))
    )
    known = reading.stopped in set(StopReason)
    stopped = StopReason(reading.stopped).describe() if known else reading.stopped
    stage_s = ends[-1] if reading.stage_s is None else reading.stage_s
    width = 1.0
    if picture is not None and picture.frame is not None:
        width = min(_THICKEST_MM, _SHARE * _gap_mm(reading.passes)) / picture.frame[2]
    return FeltView(passes, stage_s, stopped, picture, round(width, 2))


def _gap_mm(passes: Sequence[PassRecord]) -> float:
    """Between neighbouring lines, where they lie closest: half of the gaps of a direction are smaller."""
    gaps = []
    for ways in ((0, 180), (90, 270)):
        lines = sorted({v for p in passes if p.direction_deg in ways for v in p.line_mm})
        gaps += [median(b - a for a, b in pairwise(lines))] if len(lines) > 1 else []
    return min(gaps, default=_THICKEST_MM / _SHARE)


def _path(one: PassRecord, picture: PictureView) -> str:
    assert picture.frame is not None
    x0_mm, y0_mm, mm = picture.frame
    along_x = one.direction_deg in (0, 180)
    (along0, across0) = (x0_mm, y0_mm) if along_x else (y0_mm, x0_mm)
    begin, end = ((v - along0) / mm + 0.5 for v in one.along_mm)
    lines = ((v - across0) / mm + 0.5 for v in one.line_mm)
    if along_x:
        return "".join(f"M{begin:.1f} {at:.1f}H{end:.1f}" for at in lines)
    return "".join(f"M{at:.1f} {begin:.1f}V{end:.1f}" for at in lines)


def _colour(share: float) -> str:
    """Of a turn, 0 the first and 1 the last."""
    place = share * (len(_COLOURS) - 1)
    k = min(int(place), len(_COLOURS) - 2)
    mixed = (round(a + (place - k) * (b - a)) for a, b in zip(_COLOURS[k], _COLOURS[k + 1], strict=True))
    return "#" + "".join(f"{v:02x}" for v in mixed)
