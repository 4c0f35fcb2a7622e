"""The pictures of a part with the boxes of its characters, in pixels, upright, cut to the line.

    picture, width x height pixels              view of the line
    +--------------------------------+          +----------------+
    |        +--+ +--+ +--+          |  ----->  |  +--+ +--+ +--+|
    |        |K | |X | |4 |          |          |  |K | |X | |4 ||
    |        +--+ +--+ +--+          |          |  +--+ +--+ +--+|
    +--------------------------------+          +----------------+

The middle of pixel (0, 0) is (x0_mm, y0_mm); on the page its corner is the origin, so that middle is (0.5, 0.5).
A line that runs upwards, downwards or upside down is turned by quarters, so that boxes stay parallel to the axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartRecord
from pipeline.service.pages.places import LOW_MARGIN, aligned, places_of
from pipeline.store.evidence_folder import EvidenceFolder, FileState

MARGIN_HEIGHTS = (0.8, 1.3)
"""Beside, and above and below the boxes in the view of the line, in heights of a character."""
DOUBTED_MARGIN_HEIGHTS = (2.5, 1.8)
"""The same where the reading is not believed: its boxes may well miss an end of the line."""
_BELIEVED_FROM = 0.5
WIDE_ASPECT = 5.0
"""Views wider than so many heights stand below each other, not side by side."""
_NEARLY_ALL = 0.85
_MOST_ALIKE = 0.5
"""Of the places of two readings of the same line; readings of different places agree by chance in few."""
_TOUCH = ("tactile", "fused")
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True)
class PictureBox:
    """A character on a picture.

    Attributes:
        place: of the reading shown, that is chosen with it; None where no place answers to it.
        char: as this reading has it.
        doubt: of this reading's place.
        x, y, width, height: pixels of the page's picture.
    """

    place: int | None
    char: str
    doubt: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class PictureView:
    """A picture as the page shows it.

    Attributes:
        which: photo or edges.
        title: for its head.
        href: address; empty where there is none to be shown.
        note: why there is none, or what to know about it; empty where there is nothing.
        source: of the reading whose boxes are drawn; empty where none are.
        width, height: pixels; 0 where they are not known.
        transform: of the picture, for SVG; empty where it is not turned.
        whole, line: views (x, y, width, height) of the whole picture and of the line.
        boxes: of the characters.
        frame: (x of the middle of its first pixel, y of it, size of a pixel), mm; None where that is not known.
    """

    which: str
    title: str
    href: str = ""
    note: str = ""
    source: str = ""
    width: float = 0.0
    height: float = 0.0
    transform: str = ""
    whole: Rectangle = (0.0, 0.0, 1.0, 1.0)
    line: Rectangle = (0.0, 0.0, 1.0, 1.0)
    boxes: tuple[PictureBox, ...] = ()
    frame: tuple[float, float, float] | None = None

    @property
    def cut(self) -> bool:
        """Whether the line's view is less than the whole."""
        return self.line != self.whole

    @property
    def wide(self) -> bool:
        """Whether it is too wide to stand beside another."""
        return bool(self.href) and self.line[2] > WIDE_ASPECT * self.line[3]


def picture_pair(
    part: PartRecord,
    readings: Sequence[ReadingRecord],
    evidence: Sequence[EvidenceRecord],
    folder: EvidenceFolder,
    *,
    low_margin: float = LOW_MARGIN,
) -> tuple[PictureView, PictureView]:
    """The photograph and the tactile edge map.

    The camera's boxes are shown, and the photograph is cut to them, where the camera's reading is the one that counts
    or has found the same line; else the photograph is shown whole: touch knows better where the line is, and what it
    was felt in need not be the photograph's frame.
    """
    by_camera = _last(readings, ("vision",))
    believed = by_camera if by_camera is None or _same_line(by_camera, part.reading) else None
    photo = _view(
        part, believed, _record(evidence, EvidenceKind.PHOTO_PICTURE), folder,
        which="photo", title="Photograph", missing="No photograph was sent with this part.",
        low_margin=low_margin,
    )  # fmt: skip
    if believed is not by_camera and photo.boxes == () and photo.frame is not None:
        photo = replace(
            photo, note="The camera read something else here than touch, so its boxes are not drawn."
        )
    by_touch = _last(readings, _TOUCH)
    edges = _record(evidence, EvidenceKind.EDGES_PICTURE)
    missing = (
        "This part has not been scanned yet." if by_touch is None else "No edge map was kept of this part."
    )
    return photo, _view(
        part, by_touch, edges, folder,
        which="edges", title="Tactile edge map", missing=missing, low_margin=low_margin,
    )  # fmt: skip


def _same_line(by_camera: ReadingRecord, counts: ReadingRecord | None) -> bool:
    """Whether the camera has found the line that counts: as many places, and most of them alike."""
    if counts is None or counts.source == by_camera.source:
        return True
    here, there = ([c.char for c in r.characters] for r in (by_camera, counts))
    alike = sum(a == b for a, b in zip(here, there, strict=False))
    return len(here) == len(there) and alike >= _MOST_ALIKE * len(there)


def _last(readings: Sequence[ReadingRecord], sources: tuple[str, ...]) -> ReadingRecord | None:
    return next((r for r in reversed(readings) if r.source in sources), None)


def _record(evidence: Sequence[EvidenceRecord], kind: EvidenceKind) -> EvidenceRecord | None:
    """The last of its kind, one that is still kept before one that is not."""
    of_kind = [e for e in evidence if e.kind is kind]
    return next((e for e in reversed(of_kind) if not e.gone), of_kind[-1] if of_kind else None)


def _view(
    part: PartRecord,
    reading: ReadingRecord | None,
    record: EvidenceRecord | None,
    folder: EvidenceFolder,
    *,
    which: str,
    title: str,
    missing: str,
    low_margin: float,
) -> PictureView:
    if record is None:
        return PictureView(which, title, note=missing)
    if record.gone:
        return PictureView(which, title, note="This picture was kept for its time and is gone.")
    state = folder.state(record.sha256)
    if state is FileState.MISSING:
        return PictureView(which, title, note="This picture is missing from the service’s folder.")
    if state is FileState.DAMAGED:
        return PictureView(which, title, note="This picture is damaged on the service’s disk.")
    href = f"/v1/parts/{part.id}/pictures/{which}?v={record.sha256[:12]}"
    frame = _frame(record.meta)
    if frame is None:
        return PictureView(which, title, href, "Its scale is not known, so no boxes are drawn.")
    width, height = record.meta["width"], record.meta["height"]
    turns = 0 if reading is None else round(reading.rotation_deg / 90.0) % 4
    boxes = () if reading is None else _boxes(part, reading, frame, (width, height), turns, low_margin)
    whole = _turned((0.0, 0.0, width, height), (width, height), turns)
    return PictureView(
        which,
        title,
        href,
        note="" if boxes else "No characters were found here.",
        source=reading.source if reading is not None and boxes else "",
        width=width,
        height=height,
        transform=f"rotate({-90 * turns} {0.5 * width:g} {0.5 * height:g})" if turns else "",
        whole=_rounded(whole),
        line=_rounded(
            _line(boxes, whole, believed=reading is not None and reading.confidence >= _BELIEVED_FROM)
        ),
        boxes=boxes,
        frame=frame,
    )


def _frame(meta: Mapping[str, float]) -> tuple[float, float, float] | None:
    """(x0_mm, y0_mm, mm_per_pixel), where all that boxes need is known and can be."""
    values = [meta.get(name, math.nan) for name in ("x0_mm", "y0_mm", "mm_per_pixel", "width", "height")]
    if not all(math.isfinite(v) for v in values) or min(values[2:]) <= 0.0:
        return None
    return values[0], values[1], values[2]


def _boxes(
    part: PartRecord,
    reading: ReadingRecord,
    frame: tuple[float, float, float],
    size: tuple[float, float],
    turns: int,
    low_margin: float,
) -> tuple[PictureBox, ...]:
    places = places_of(reading, low_margin=low_margin)
    shown = [p.char for p in places_of(part.reading)]
    answers = aligned(shown, [p.char for p in places])
    x0_mm, y0_mm, mm = frame
    made = []
    for place, character, answer in zip(places, reading.characters, answers, strict=True):
        left, top, right, bottom = character.box
        pixels = (
            (left - x0_mm) / mm + 0.5,
            (top - y0_mm) / mm + 0.5,
            (right - left) / mm,
            (bottom - top) / mm,
        )
        if not _drawable(pixels, size):
            continue
        made.append(PictureBox(answer, place.char, place.doubt, *_rounded(_turned(pixels, size, turns))))
    return tuple(made)


def _drawable(box: Rectangle, size: tuple[float, float]) -> bool:
    """Whether it has an area and something of it is on the picture."""
    x, y, width, height = box
    if not all(math.isfinite(v) for v in box) or min(width, height) <= 0.0:
        return False
    return x < size[0] and y < size[1] and x + width > 0.0 and y + height > 0.0


def _turned(box: Rectangle, size: tuple[float, float], turns: int) -> Rectangle:
    """A box after so many quarters against the clock about the middle of the picture."""
    x, y, width, height = box
    cx, cy = 0.5 * size[0], 0.5 * size[1]
    for _ in range(turns):
        x, y, width, height = cx + (y - cy), cy - (x + width - cx), height, width
    return (x, y, width, height)


def _line(boxes: Sequence[PictureBox], whole: Rectangle, *, believed: bool) -> Rectangle:
    """The view of the line within the whole."""
    if not boxes:
        return whole
    margins = MARGIN_HEIGHTS if believed else DOUBTED_MARGIN_HEIGHTS
    beside, above = (m * median(b.height for b in boxes) for m in margins)
    x0 = max(whole[0], min(b.x for b in boxes) - beside)
    y0 = max(whole[1], min(b.y for b in boxes) - above)
    x1 = min(whole[0] + whole[2], max(b.x + b.width for b in boxes) + beside)
    y1 = min(whole[1] + whole[3], max(b.y + b.height for b in boxes) + above)
    line = (x0, y0, x1 - x0, y1 - y0)
    nearly = line[2] > _NEARLY_ALL * whole[2] and line[3] > _NEARLY_ALL * whole[3]
    return whole if nearly else line


def _rounded(box: Rectangle) -> Rectangle:
    x, y, width, height = (round(v, 2) for v in box)
    return (x, y, width, height)
