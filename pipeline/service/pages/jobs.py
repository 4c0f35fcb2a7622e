"""Pages of jobs: the list, the text of a job, and a job taught from a part: a box round a line, and its text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Form
from pydantic import AfterValidator, BaseModel
from starlette.responses import PlainTextResponse, Response

from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import Box, LineRecord, ReadingRecord
from pipeline.common.records import PartRecord, PartStory
from pipeline.common.serial_format import format_like
from pipeline.common.settings import NamedLine, ReadSettings, Region
from pipeline.service.jobs import JobAnswer, JobFolder, name_like, save_edited, teach, text_to_edit
from pipeline.service.pages.frame import Frame, View
from pipeline.service.pages.pictures import TOUCH, PictureFrame, PictureView, last_reading, picture_pair
from pipeline.service.web.problem import Problem

MOST_TEXT = 200
_SIDES = ("left", "top", "right", "bottom")
_WHOLE: Region = (0.0, 0.0, 1.0, 1.0)
# room about a line that was read, in heights of its characters: lines stand twice as far apart and more
_ROOM_HEIGHTS = 0.25
Lines = Annotated[str, AfterValidator(lambda text: text.replace("\r\n", "\n"))]
Typed = Annotated[str, AfterValidator(lambda text: text.strip()[:MOST_TEXT])]


class Lesson(BaseModel):
    """The form that teaches a line, as typed: sides of the box in per cent, `line` empty for the serial."""

    name: Typed = ""
    line: Typed = ""
    text: Typed = ""
    format: Typed = ""
    height_mm: Typed = ""
    left: Typed = ""
    top: Typed = ""
    right: Typed = ""
    bottom: Typed = ""
    database: Typed = ""
    replace: str = ""
    part: str = ""
    by: str = ""

    def taught(self) -> tuple[NamedLine, float | None]:
        """The taught line, and the height of its characters. Raises Problem: no number, no box, or no text."""
        if not self.text:
            raise Problem(422, "type the text that stands in the box")
        try:
            left, top, right, bottom = (_number(getattr(self, side)) / 100.0 for side in _SIDES)
            height_mm = _number(self.height_mm) if self.height_mm else None
        except ValueError as error:
            raise Problem(422, f"{str(error)[-40:]} is not a number; type 12.5, for example") from error
        if not (0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0):
            raise Problem(422, "draw a box first, or type left < right and top < bottom, 0 to 100")
        format = self.format or format_like(self.text)
        return NamedLine(self.line, format, (left, top, right, bottom)), height_mm


class Edit(BaseModel):
    """The form that edits the text of a job; browsers end lines with CR LF."""

    text: Lines = ""
    before: Lines = ""
    action: str = "save"
    sure: str = ""


def add_job_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of the list, of the text of a job, and of teaching a job."""
    looks, reviews = Depends(frame.reader_view), Depends(frame.reviewer_view)
    jobs = frame.service.jobs

    @router.get("/jobs")
    def listed(done: str = "", part: str = "", gone: str = "", view: View = looks) -> Response:
        shown = jobs.listed()
        names = [job.name for job in shown]
        return view.page(
            "jobs.html.j2",
            jobs=[(job, _lines(job)) for job in shown],
            done=done if done in names else "",
            more=urlencode({"part": part, "name": done}) if is_part_id(part) else "",
            gone="" if gone in names else gone,
        )

    @router.get("/jobs/edit/{name}")
    def edit(name: str, view: View = reviews) -> Response:
        return _edit_page(view, jobs, name)

    @router.post("/jobs/edit/{name}")
    def save_edit(name: str, edit: Annotated[Edit, Form()], view: View = reviews) -> Response:
        try:
            if edit.action != "delete":
                save_edited(jobs, name, edit.text, before=edit.before)
                return view.redirect(f"/jobs?{urlencode({'done': name})}")
            if not edit.sure:
                raise Problem(422, "tick the box beside Delete first")
            jobs.delete(name)
        except Problem as problem:
            return _edit_page(view, jobs, name, edit, problem)
        return view.redirect(f"/jobs?{urlencode({'gone': name})}")

    @router.get("/jobs/format")
    def format_of(text: str = "", view: View = looks) -> Response:
        return PlainTextResponse(format_like(text[:MOST_TEXT]))

    @router.get("/jobs/new")
    def new(part: str, by: str = "", name: str = "", view: View = reviews) -> Response:
        story = frame.store.story(part)
        picture, *_ = _pictures(frame, story, by)
        reading = last_reading(story.readings, ("vision",) if picture.which == "photo" else TOUCH)
        lesson = _propose_lines(story.part, reading, picture.frame, job=name)
        return _teach_page(view, jobs, lesson.model_copy(update={"part": part, "by": by}))

    @router.post("/jobs/new")
    def save(lesson: Annotated[Lesson, Form()], view: View = reviews) -> Response:
        try:
            line, height_mm = lesson.taught()
            replace, database = bool(lesson.replace), lesson.database
            teach(
                jobs, lesson.name, line, lesson.text, height_mm=height_mm, database=database, replace=replace
            )
        except Problem as problem:
            return _teach_page(view, jobs, lesson, problem)
        return view.redirect(f"/jobs?{urlencode({'done': lesson.name, 'part': lesson.part})}")


def _teach_page(view: View, jobs: JobFolder, lesson: Lesson, problem: Problem | None = None) -> Response:
    story = view.frame.store.story(lesson.part)
    picture, *others = _pictures(view.frame, story, lesson.by)
    return view.page(
        "teach.html.j2",
        problem=problem,
        part=story.part,
        picture=picture,
        others=others,
        shown=lesson,
        sides=_SIDES,
        names=[job.name for job in jobs.listed()],
        databases=[database["name"] for database in jobs.databases.listed()],
        most=MOST_TEXT,
        may_replace=problem is not None and problem.status == 409,
    )


def _edit_page(
    view: View, jobs: JobFolder, name: str, edit: Edit | None = None, problem: Problem | None = None
) -> Response:
    job, stands = jobs.answer(name), text_to_edit(jobs, name)
    edit = edit or Edit(text=stands, before=stands)
    return view.page("job.html.j2", problem=problem, job=job, text=edit.text, before=edit.before)


def _pictures(frame: Frame, story: PartStory, by: str) -> list[PictureView]:
    pair = picture_pair(story, frame.service.evidence)
    pictures = [view for view in pair if view.href and view.frame is not None]
    if not pictures:
        raise Problem(
            404, "there is no picture of this part to draw a box on; teach the job from another part"
        )
    return sorted(pictures, key=lambda view: view.which != by)


def _propose_lines(
    part: PartRecord, reading: ReadingRecord | None, frame: PictureFrame | None, *, job: str
) -> Lesson:
    text, height, boxes = part.text, "", [] if reading is None else [c.box for c in reading.characters]
    if job:
        others = (line for line in (reading.lines if reading is not None else ()) if not line.name)
        line = next(others, LineRecord("", "", 0.0))
        text, boxes = line.text, [box for box in (line.box_mm or line.box_px,) if box is not None]
    elif part.reading is not None and part.reading.source in TOUCH and part.reading.height_mm is not None:
        height = f"{part.reading.height_mm:.2f}"  # the camera's scale is seldom so well known as touch's
    name = job or part.job or name_like(part.name)
    return Lesson(name=name, text=text, format=format_like(text), height_mm=height, **_box(boxes, frame))


def _box(boxes: Sequence[Box], frame: PictureFrame | None) -> dict[str, str]:
    region = _WHOLE
    if boxes and frame is not None:
        room = _ROOM_HEIGHTS * max(b[3] - b[1] for b in boxes)
        lefts, tops, rights, bottoms = zip(*boxes, strict=True)
        hull = (min(lefts) - room, min(tops) - room, max(rights) + room, max(bottoms) + room)
        x, y, width, height = frame.pixels(hull)
        shares = (x / frame.width, y / frame.height, (x + width) / frame.width, (y + height) / frame.height)
        left, top, right, bottom = (min(1.0, max(0.0, share)) for share in shares)
        region = (left, top, right, bottom) if left < right and top < bottom else _WHOLE
    return {side: f"{100.0 * share:.1f}" for side, share in zip(_SIDES, region, strict=True)}


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _lines(job: JobAnswer) -> tuple[NamedLine, ...]:
    known = ReadSettings.of(**{key: job.settings[key] for key in ("region", "line") if key in job.settings})
    formats = job.settings.get("format", ())
    written = formats if isinstance(formats, str) else " and ".join(formats)
    return (NamedLine("", written, known.region), *map(NamedLine.parse, known.line))
