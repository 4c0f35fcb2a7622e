"""Pages of jobs: the list, and a job taught from a part: a box drawn round a line, its text typed.

part --its picture, box, text--> /jobs/new --> job file --> /jobs
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord, Scope
from pipeline.common.serial_format import format_like
from pipeline.common.settings import NamedLine, ReadSettings, Region
from pipeline.service.job_edit import save_edited, text_to_edit
from pipeline.service.job_folder import JobAnswer, JobFolder
from pipeline.service.pages.frame import Frame, PageError, see
from pipeline.service.pages.pictures import PictureView, picture_pair
from pipeline.service.teaching import Taught, name_like, teach
from pipeline.service.web.problem import Problem

MOST_TEXT = 200
_WHOLE: Region = (0.0, 0.0, 1.0, 1.0)
_TOUCH = ("tactile", "fused")
_ROOM_HEIGHTS = 0.5
"""About a line that was read, in heights of its characters: lines seldom stand closer."""


@dataclass(frozen=True)
class Shown:
    """The form, as it is shown and as it comes back.

    Attributes:
        name: of the job.
        line: of the line; empty for the serial.
        text: that stands there.
        format: of the text.
        height_mm: of characters, as typed.
        database: of a learned die, by name.
        box: left, top, right and bottom of the region, per cent of the picture.
        replace: whether a line that the job has may be replaced.
    """

    name: str
    line: str
    text: str
    format: str
    height_mm: str
    box: tuple[str, ...]
    database: str = ""
    replace: bool = False

    def taught(self) -> Taught:
        """What it says.

        Raises:
            Problem: a number that is none, nothing typed.
        """
        if not self.text:
            raise Problem(422, "type the text that stands in the box")
        try:
            left, top, right, bottom = (_number(side) / 100.0 for side in self.box)
            height_mm = _number(self.height_mm) if self.height_mm else None
        except ValueError as error:
            raise Problem(422, f"{str(error)[-40:]} is no number; type 12.5, say") from error
        region = (left, top, right, bottom)
        if not (0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0):
            raise Problem(422, "the box is none; draw one, or type left < right and top < bottom, 0 to 100")
        format = self.format or format_like(self.text)
        return Taught(self.line, self.text, format, region, height_mm, self.database)


@dataclass(frozen=True)
class ListedJob:
    """A job as the list shows it.

    Attributes:
        name: of the job.
        lines: the serial first, its name empty: name, format and region of each.
        more: other settings, in words.
        problem: why it cannot be used as its file now is.
    """

    name: str
    lines: tuple[NamedLine, ...]
    more: str
    problem: str


def add_job_pages(router: APIRouter, frame: Frame, jobs: JobFolder) -> None:
    """The routes of the list, and of a job to be taught."""

    @router.get("/jobs")
    def listed(request: Request, done: str = "", part: str = "", gone: str = "") -> Response:
        caller = frame.reader(request)
        shown = [_listed(job) for job in jobs.listed()]
        known = done if any(job.name == done for job in shown) else ""
        more = urlencode({"part": part, "name": done}) if is_part_id(part) else ""
        return frame.page(
            request,
            "jobs.html.j2",
            caller=caller,
            jobs=shown,
            done=known,
            more=more,
            gone=gone if gone and not any(job.name == gone for job in shown) else "",
            may_edit=Scope.REVIEW in caller.scopes,
        )

    @router.get("/jobs/edit/{name}")
    def edit(request: Request, name: str) -> Response:
        frame.access.caller(request, Scope.REVIEW)
        return _edit_page(frame, request, jobs, name)

    @router.post("/jobs/edit/{name}")
    def save_edit(
        request: Request,
        name: str,
        action: Annotated[str, Form()] = "save",
        text: Annotated[str, Form()] = "",
        before: Annotated[str, Form()] = "",
        sure: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        text, before = (value.replace("\r\n", "\n") for value in (text, before))
        try:
            if action == "delete":
                if not sure:
                    raise Problem(422, "tick the box beside Delete first")
                jobs.delete(name)
                return see(request, f"/jobs?{urlencode({'gone': name})}")
            save_edited(jobs, name, text, before=before)
        except Problem as problem:
            return _edit_page(frame, request, jobs, name, text=text, before=before, problem=problem)
        return see(request, f"/jobs?{urlencode({'done': name})}")

    @router.get("/jobs/format")
    def format_of(request: Request, text: str = "") -> Response:
        frame.reader(request)
        return PlainTextResponse(format_like(text[:MOST_TEXT]))

    @router.get("/jobs/new")
    def new(request: Request, part: str, by: str = "", name: str = "") -> Response:
        found = frame.store.part(part)
        pictures = _pictures(frame, found)
        picture = next((one for one in pictures if one.which == by), pictures[0])
        reading = _reading(frame, found, picture)
        shown = _another(name, reading, picture) if name else _proposed(found, reading, picture)
        return _teach_page(frame, request, jobs, found, picture, shown)

    @router.post("/jobs/new")
    def save(
        request: Request,
        part: Annotated[str, Form()],
        by: Annotated[str, Form()] = "",
        name: Annotated[str, Form()] = "",
        line: Annotated[str, Form()] = "",
        text: Annotated[str, Form()] = "",
        format: Annotated[str, Form()] = "",
        height_mm: Annotated[str, Form()] = "",
        left: Annotated[str, Form()] = "",
        top: Annotated[str, Form()] = "",
        right: Annotated[str, Form()] = "",
        bottom: Annotated[str, Form()] = "",
        database: Annotated[str, Form()] = "",
        replace: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        name, line, text, format, height_mm, *box = (
            value.strip()[:MOST_TEXT]
            for value in (name, line, text, format, height_mm, left, top, right, bottom)
        )
        shown = Shown(name, line, text, format, height_mm, tuple(box), database, bool(replace))
        try:
            teach(jobs, shown.name, shown.taught(), replace=shown.replace)
        except Problem as problem:
            found = frame.store.part(part)
            pictures = _pictures(frame, found)
            picture = next((one for one in pictures if one.which == by), pictures[0])
            return _teach_page(frame, request, jobs, found, picture, shown, problem)
        return see(request, f"/jobs?{urlencode({'done': shown.name, 'part': part})}")


def _teach_page(
    frame: Frame,
    request: Request,
    jobs: JobFolder,
    part: PartRecord,
    picture: PictureView,
    shown: Shown,
    problem: Problem | None = None,
) -> Response:
    caller = frame.access.caller(request, Scope.REVIEW)
    others = [one for one in _pictures(frame, part) if one.which != picture.which]
    return frame.page(
        request,
        "teach.html.j2",
        status=200 if problem is None else problem.status,
        caller=caller,
        part=part,
        picture=picture,
        others=others,
        shown=shown,
        names=[job.name for job in jobs.listed()],
        databases=[one["name"] for one in jobs.databases.listed()],
        most=MOST_TEXT,
        fault="" if problem is None else problem.detail,
        may_replace=problem is not None and problem.status == 409,
    )


def _edit_page(
    frame: Frame,
    request: Request,
    jobs: JobFolder,
    name: str,
    *,
    text: str | None = None,
    before: str | None = None,
    problem: Problem | None = None,
) -> Response:
    """The text of a job, to be saved or deleted.

    Raises:
        PageError: there is no such job.
    """
    job = next((one for one in jobs.listed() if one.name == name), None)
    if job is None:
        raise PageError(404, "There is no such job; somebody may have deleted it.")
    stands = text_to_edit(jobs, name)
    return frame.page(
        request,
        "job.html.j2",
        status=200 if problem is None else problem.status,
        caller=frame.access.caller(request, Scope.REVIEW),
        job=job,
        text=stands if text is None else text,
        before=stands if before is None else before,
        fault="" if problem is None else problem.detail,
    )


def _pictures(frame: Frame, part: PartRecord) -> list[PictureView]:
    """The pictures of a part that a box can be drawn on, of the photograph first.

    Raises:
        PageError: there is none.
    """
    readings, evidence = frame.store.readings(part.id), frame.store.evidence(part.id)
    pair = picture_pair(part, readings, evidence, frame.evidence, low_margin=frame.low_margin)
    found = [one for one in pair if one.href and one.frame is not None]
    if not found:
        raise PageError(404, "There is no picture of this part to draw a box on; teach the job from another.")
    return found


def _reading(frame: Frame, part: PartRecord, picture: PictureView) -> ReadingRecord | None:
    """The last reading that was made of what the picture shows."""
    sources = ("vision",) if picture.which == "photo" else _TOUCH
    readings = frame.store.readings(part.id)
    return next((one for one in reversed(readings) if one.source in sources), None)


def _proposed(part: PartRecord, reading: ReadingRecord | None, picture: PictureView) -> Shown:
    """The line that was read, with room about it; the whole picture where none was."""
    boxes = () if reading is None else [c.box for c in reading.characters]
    # the camera's scale is seldom so well known as touch's
    felt = part.reading if part.reading is not None and part.reading.source in _TOUCH else None
    height_mm = None if felt is None else felt.height_mm
    return Shown(
        name=part.job or name_like(part.name),
        line="",
        text=part.text,
        format=format_like(part.text),
        height_mm="" if height_mm is None else f"{height_mm:.2f}",
        box=_per_cent(_around(boxes, picture)),
    )


def _another(name: str, reading: ReadingRecord | None, picture: PictureView) -> Shown:
    """Another line of a job: one that was read beside the serial and that nobody has named yet, if there is any."""
    lines = () if reading is None else reading.lines
    found = next((line for line in lines if not line.name), None)
    text = "" if found is None else found.text
    box = None if found is None else found.box_mm or found.box_px
    return Shown(
        name, "", text, format_like(text), "", _per_cent(_around(() if box is None else (box,), picture))
    )


def _around(boxes: Sequence[tuple[float, float, float, float]], picture: PictureView) -> Region:
    if not boxes or picture.frame is None:
        return _WHOLE
    (x0_mm, y0_mm, mm), width, height = picture.frame, picture.width, picture.height
    room = _ROOM_HEIGHTS * max(b[3] - b[1] for b in boxes)
    left, top = min(b[0] for b in boxes) - room, min(b[1] for b in boxes) - room
    right, bottom = max(b[2] for b in boxes) + room, max(b[3] for b in boxes) + room
    x = [min(1.0, max(0.0, ((v - x0_mm) / mm + 0.5) / width)) for v in (left, right)]
    y = [min(1.0, max(0.0, ((v - y0_mm) / mm + 0.5) / height)) for v in (top, bottom)]
    return (x[0], y[0], x[1], y[1]) if x[0] < x[1] and y[0] < y[1] else _WHOLE


def _per_cent(region: Region) -> tuple[str, ...]:
    return tuple(f"{100.0 * share:.1f}" for share in region)


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _listed(job: JobAnswer) -> ListedJob:
    settings = ReadSettings.of(
        **{key: job.settings[key] for key in ("region", "line") if key in job.settings}
    )
    formats = job.settings.get("format", ())
    written = formats if isinstance(formats, str) else " and ".join(formats)
    lines = (NamedLine("", written, settings.region), *map(NamedLine.parse, settings.line))
    more = {key: value for key, value in job.settings.items() if key not in ("format", "region", "line")}
    words = "; ".join(
        f"{key} {', '.join(map(str, value)) if isinstance(value, list) else value}"
        for key, value in more.items()
    )
    return ListedJob(job.name, lines, words, job.problem)
