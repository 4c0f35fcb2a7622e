"""The pictures of a part with the boxes of its characters, in pixels, upright, cut to the line. The middle of pixel (0,
0) is (x0_mm, y0_mm); on the page it is (0.5, 0.5). A line that does not run to the right is turned by quarters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

from pipeline.common.reading_records import Box, ReadingRecord
from pipeline.common.records import EvidenceKind, PartRecord, PartStory
from pipeline.service.pages.places import align_places, places_of
from pipeline.store.evidence_folder import EvidenceFolder, FileState

# beside, and above and below the boxes in the view of the line, in heights of a character
_MARGIN_HEIGHTS = (0.8, 1.3)
# the same below a confidence of 0.5: the boxes may miss an end of the line
_UNSURE_MARGIN_HEIGHTS, _SURE_FROM = (2.5, 1.8), 0.5
# above a box, for the character that the template writes there, in heights of the box
_LABEL_ROOM = 0.5
# views wider than this many heights stand below each other, not side by side
_WIDE_ASPECT = 5.0
# a view of the line with at least this share of the whole is not cropped
_NEARLY_ALL = 0.85
# share of equal places from which two readings are of one line; readings of other lines agree by chance in few
_LEAST_ALIKE = 0.5
TOUCH = ("tactile", "fused")
_ABSENT = {
    FileState.MISSING: "This picture is missing from the service’s folder.",
    FileState.DAMAGED: "This picture is damaged on the service’s disk.",
}
# x, y, width, height in pixels
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True)
class PictureFrame:
    """Position of a picture, and its size in pixels."""

    x0_mm: float
    y0_mm: float
    mm_per_pixel: float
    width: float
    height: float

    @classmethod
    def of(cls, meta: Mapping[str, float]) -> PictureFrame | None:
        values = [meta.get(name, math.nan) for name in cls.__dataclass_fields__]
        return cls(*values) if all(map(math.isfinite, values)) and min(values[2:]) > 0.0 else None

    def pixels(self, box: Box) -> Rectangle:
        """A box, x0, y0, x1, y1 in mm, on the picture."""
        (left, top, right, bottom), mm = box, self.mm_per_pixel
        return (
            (left - self.x0_mm) / mm + 0.5, (top - self.y0_mm) / mm + 0.5,
            (right - left) / mm, (bottom - top) / mm,
        )  # fmt: skip

    def shows(self, box: Rectangle) -> bool:
        x, y, width, height = box
        if not all(map(math.isfinite, box)) or min(width, height) <= 0.0:
            return False
        return x < self.width and y < self.height and x + width > 0.0 and y + height > 0.0

    def whole(self, turns: int) -> Rectangle:
        return self.turned((0.0, 0.0, self.width, self.height), turns)

    def turned(self, box: Rectangle, turns: int) -> Rectangle:
        """A box after a number of quarter turns counterclockwise about the middle of the picture."""
        x, y, width, height = box
        cx, cy = 0.5 * self.width, 0.5 * self.height
        for _ in range(turns):
            x, y, width, height = cx + (y - cy), cy - (x + width - cx), height, width
        return (round(x, 2), round(y, 2), round(width, 2), round(height, 2))


@dataclass(frozen=True)
class PictureBox:
    """A character on a picture, and its place of the part's reading, if one matches it."""

    place: int | None
    char: str
    doubt: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class PictureView:
    """A picture on the page."""

    which: str
    title: str
    href: str = ""  # empty if there is none to be shown; `note` says why, or what to know about it
    note: str = ""
    frame: PictureFrame | None = None
    source: str = ""  # of the reading whose boxes are drawn; empty if none are
    turns: int = 0  # quarters counterclockwise by which it is turned
    whole: Rectangle = (0.0, 0.0, 1.0, 1.0)
    line: Rectangle = (0.0, 0.0, 1.0, 1.0)
    boxes: tuple[PictureBox, ...] = ()
    # False where no picture is expected: the page then leaves out its frame
    takes_room: bool = True

    @property
    def wide(self) -> bool:
        return bool(self.href) and self.line[2] > _WIDE_ASPECT * self.line[3]


def picture_pair(story: PartStory, folder: EvidenceFolder) -> tuple[PictureView, PictureView]:
    """The photograph and the tactile edge map; the photograph without boxes if touch has read another line."""
    by_camera, by_touch = (last_reading(story.readings, sources) for sources in (("vision",), TOUCH))
    same = by_camera is None or _same_line(by_camera, story.part.reading)
    photo = _view(story, by_camera if same else None, folder, kind=EvidenceKind.PHOTO_PICTURE)
    if not same and photo.frame is not None:
        note = "The camera read something else here than touch, so its boxes are not drawn."
        photo = replace(photo, note=note)
    return photo, _view(story, by_touch, folder, kind=EvidenceKind.EDGES_PICTURE)


def without_reading(view: PictureView) -> PictureView:
    """The picture for a blind reader: upright, but whole and without boxes, as the line may be wrong, too."""
    note = "" if view.href else view.note
    if view.frame is None:
        return replace(view, note=note)
    whole = view.frame.whole(view.turns)
    return replace(view, boxes=(), source="", line=whole, whole=whole, note=note)


def last_reading(readings: Sequence[ReadingRecord], sources: Sequence[str]) -> ReadingRecord | None:
    """The last reading by one of the sources."""
    return next((r for r in reversed(readings) if r.source in sources), None)


def last_felt(readings: Sequence[ReadingRecord]) -> ReadingRecord | None:
    """The last reading that was felt pass by pass."""
    return next((r for r in reversed(readings) if r.passes), None)


def _same_line(by_camera: ReadingRecord, stands: ReadingRecord | None) -> bool:
    if stands is None or stands.source == by_camera.source:
        return True
    here, there = ([c.char for c in r.characters] for r in (by_camera, stands))
    alike = sum(a == b for a, b in zip(here, there, strict=False))
    return len(here) == len(there) and alike >= _LEAST_ALIKE * len(there)


def _view(
    story: PartStory, reading: ReadingRecord | None, folder: EvidenceFolder, *, kind: EvidenceKind
) -> PictureView:
    part, photo = story.part, kind is EvidenceKind.PHOTO_PICTURE
    which, title = ("photo", "Photograph") if photo else ("edges", "Tactile edge map")
    pictures = [e for e in story.evidence if e.kind is kind]
    record = next((e for e in reversed(pictures) if not e.gone), None)
    if record is None:
        unscanned = "This part has not been scanned yet." if reading is None else "No edge map was kept."
        never = "No photograph was sent with this part." if photo else unscanned
        note = "This picture is deleted: its time was up." if pictures else never
        return PictureView(
            which, title, note=note, takes_room=bool(photo or pictures or reading or part.touch)
        )
    if absent := _ABSENT.get(folder.state(record.sha256)):
        return PictureView(which, title, note=absent)
    href = f"/v1/parts/{part.id}/pictures/{which}?v={record.sha256[:12]}"
    frame = PictureFrame.of(record.meta)
    if frame is None:
        return PictureView(which, title, href, "Its scale is not known, so no boxes are drawn.")
    turns = 0 if reading is None else round(reading.rotation_deg / 90.0) % 4
    boxes = () if reading is None else _boxes(part, reading, frame, turns)
    whole = _with_boxes(frame.whole(turns), boxes)
    return PictureView(
        which,
        title,
        href,
        note="" if boxes else "No characters were found here.",
        frame=frame,
        source=reading.source if reading is not None and boxes else "",
        turns=turns,
        whole=whole,
        line=_line(boxes, whole, sure=reading is not None and reading.confidence >= _SURE_FROM),
        boxes=boxes,
    )


def _with_boxes(view: Rectangle, boxes: Sequence[PictureBox]) -> Rectangle:
    x, y, width, height = view
    x0 = min([x, *(b.x for b in boxes)])
    y0 = min([y, *(b.y - _LABEL_ROOM * b.height for b in boxes)])
    x1 = max([x + width, *(b.x + b.width for b in boxes)])
    y1 = max([y + height, *(b.y + b.height for b in boxes)])
    return (round(x0, 2), round(y0, 2), round(x1 - x0, 2), round(y1 - y0, 2))


def _boxes(
    part: PartRecord, reading: ReadingRecord, frame: PictureFrame, turns: int
) -> tuple[PictureBox, ...]:
    places = places_of(reading)
    answers = align_places([p.char for p in places_of(part.reading)], [p.char for p in places])
    pixels = [frame.pixels(character.box) for character in reading.characters]
    return tuple(
        PictureBox(answer, place.char, place.doubt, *frame.turned(box, turns))
        for place, box, answer in zip(places, pixels, answers, strict=True)
        if frame.shows(box)
    )


def _line(boxes: Sequence[PictureBox], whole: Rectangle, *, sure: bool) -> Rectangle:
    if not boxes:
        return whole
    margins = _MARGIN_HEIGHTS if sure else _UNSURE_MARGIN_HEIGHTS
    beside, above = (m * median(b.height for b in boxes) for m in margins)
    x0 = max(whole[0], min(b.x for b in boxes) - beside)
    y0 = max(whole[1], min(b.y for b in boxes) - above)
    x1 = min(whole[0] + whole[2], max(b.x + b.width for b in boxes) + beside)
    y1 = min(whole[1] + whole[3], max(b.y + b.height for b in boxes) + above)
    line = _with_boxes((x0, y0, x1 - x0, y1 - y0), boxes)
    nearly = line[2] > _NEARLY_ALL * whole[2] and line[3] > _NEARLY_ALL * whole[3]
    return whole if nearly else line
