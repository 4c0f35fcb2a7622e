"""Parts over HTTP: sent, looked up and reviewed; `service_api` has the rest."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal

from fastapi import APIRouter, Depends, File, Form, Header, Path, Query, Request, Response, UploadFile
from fastapi.responses import FileResponse, StreamingResponse
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from pipeline.common.names import check_visible, folded
from pipeline.common.reading_records import to_json_bytes
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    History,
    PartRecord,
    PartState,
    ReviewAction,
    Scope,
)
from pipeline.common.texts import CSV_BEGIN, csv_line
from pipeline.plots.boxes_picture import boxes_picture
from pipeline.service.intake import NewPart, Received, Touch
from pipeline.service.stage.work import TouchCall
from pipeline.service.web.access import Access, Caller
from pipeline.service.web.problem import PROBLEMS, Problem
from pipeline.service.web.uploads import FormRoute, Upload, check_count, receive
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store

if TYPE_CHECKING:
    from pipeline.service.app import Service

# members of a character class of a regular expression: hidden characters of the Basic Multilingual Plane.
# Without half surrogates, which never come out of UTF-8.
HIDDEN = r"\x00-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ue000-\uf8ff\ufeff\ufff9-\ufffb"
TEXT = f"^[^{HIDDEN}]*$"
NOTE = f"^(?:[\\t\\n\\r]|[^{HIDDEN}])*$"
PICTURES = {"photo": EvidenceKind.PHOTO_PICTURE, "edges": EvidenceKind.EDGES_PICTURE}
PictureName = Literal["photo", "edges", "boxes"]
# columns of the table, and the field of a part's record that fills each
COLUMNS = {
    "id": "id", "name": "name", "received": "created_at", "state": "state", "serial": "text",
    "read_by": "reading.source", "decision": "reading.decision", "confidence": "reading.confidence",
    "expected": "expected", "verdict": "reading.verdict", "line": "line", "job": "job", "database": "database",
    "reviewed_by": "review.who", "review": "review.action", "reviewed": "review.at", "note": "review.note",
}  # fmt: skip
_AT_ONCE = 500
_LASTING = "private, max-age=31536000, immutable"


@dataclass(frozen=True)
class PartAnswer(PartRecord):
    """A part in its present state, with the addresses of the part, its history, and its pictures by name."""

    links: Mapping[str, str] = field(default_factory=dict)


def answer(part: PartRecord, root_path: str = "") -> PartAnswer:
    """The part with its links, with the prefix of a proxy, if any."""
    here = f"{root_path}/v1/parts/{part.id}"
    pictures = {name: f"{here}/pictures/{name}" for name in (*PICTURES, "boxes")}
    return PartAnswer(**part.__dict__, links={"self": here, "history": f"{here}/history", **pictures})


class ReviewBody(BaseModel):
    """A person's review of a part."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"action": "correct", "text": "KX407251", "who": "Anna", "before": "KX4O7251"}]
        },
    )

    action: ReviewAction
    text: str = Field("", max_length=200, pattern=TEXT, description="serial; empty for unreadable")
    who: str = Field(
        "", max_length=100, pattern=TEXT, description="name of the person; a token signs with its own name"
    )
    note: str = Field("", max_length=2000, pattern=NOTE)
    outside_format: bool = Field(
        False, description="save a serial even if it does not fit the format; otherwise the answer is 422"
    )
    before: str | None = Field(
        None, max_length=200, description="text that was seen; if it has changed since, the answer is 409"
    )


def _text(description: str, **more: Any) -> Any:
    return Form(max_length=200, pattern=TEXT, description=description, **more)


def _contains(description: str) -> Any:
    return Field("", max_length=200, pattern=TEXT, description=description)


Name = Annotated[str, _text("name of the part on the line", examples=["tray-7/part-3"])]
Expected = Annotated[str, _text("serial to verify: confirmed, refuted or undecided")]
Database = Annotated[str, _text("name of a glyph database; /v1/databases lists them")]
JobName = Annotated[
    str, _text("name of a job with the settings of reading; /v1/jobs lists them", examples=["housing-left"])
]
Time = Annotated[datetime, AfterValidator(lambda time: time if time.tzinfo else time.replace(tzinfo=UTC))]
PartId = Annotated[
    str, Path(max_length=64, description="id of the part", examples=["01JD8Z6Y3Q5V7W9X1B2C3D4E5F"])
]
Key = Annotated[
    str | None,
    Header(
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="key that the sender makes for each part; a request repeated with it makes no second part",
    ),
]


class PartFilter(BaseModel):
    """Filters of a list of parts; times without a zone are UTC."""

    model_config = ConfigDict(extra="forbid")

    state: PartState | None = None
    text: str = _contains("text that the serial contains")
    name: str = _contains("text that the name contains")
    job: str = _contains("job that the part was read by")
    line: str = _contains("line that the part comes from")
    since: Time | None = Field(
        None, description="received since then: 2026-11-21, 2026-11-21T06:00:00Z", examples=["2026-11-21"]
    )
    until: Time | None = Field(None, description="received before this time", examples=["2026-11-22"])


class PartPage(PartFilter):
    """A page of a list of parts."""

    before: str | None = Field(None, max_length=64, pattern=TEXT, description="last id of the previous page")
    limit: int = Field(50, ge=1, le=500)


def caller_with(access: Access, *scopes: Scope) -> Any:
    """The dependency of a route that only callers with one of the scopes may use."""

    def check(request: Request) -> Caller:
        return access.caller(request, *scopes)

    return Depends(check)


Photos = Annotated[
    list[UploadFile] | None,
    File(
        description="PNG, JPEG, BMP, TIFF, WebP or GIF; several, of one part under different lights, are read as one"
    ),
]
_SCAN = File(description="scan (.h5) or height map (.npz, .x3p, .sdf, .sur ...)")
Scan = Annotated[UploadFile, _SCAN]
TouchBy = Annotated[
    Touch,
    Form(
        description="who feels the part if the camera is unsure: stage, the service's stage at once; asked, that stage "
        "on a later request (/touch); plan, the sender, by the plan in the answer. Without a stage the part goes to a "
        "person, except with plan"
    ),
]
_REPLAYED: dict[int | str, dict[str, Any]] = {
    200: {"model": PartAnswer, "description": "the same request was answered before; the part as it stands"}
}


def parts_router(service: Service) -> APIRouter:
    """The routes of /v1/parts."""
    router = APIRouter(prefix="/v1", tags=["parts"], route_class=FormRoute, responses=PROBLEMS)
    Reads, Writes, Reviews = (caller_with(service.access, scope) for scope in Scope)
    # who sends a part may look up an answer that was lost
    LooksUp = caller_with(service.access, Scope.READ, Scope.WRITE)
    intake, store, files = service.intake, service.store, service.evidence
    root_path = service.settings.root_path

    @router.post(
        "/parts",
        status_code=201,
        response_model=PartAnswer,
        responses=_REPLAYED,
    )
    async def read_part(
        request: Request,
        photo: Photos = None,
        scan: Annotated[UploadFile | None, _SCAN] = None,
        name: Name = "",
        expected: Expected = "",
        database: Database = "",
        job: JobName = "",
        touch: TouchBy = Touch.ASKED,
        idempotency_key: Key = None,
        caller: Caller = Writes,
    ) -> Response:
        """Read a part from its photograph, its scan, or both.

        The answer is the reading, or that touch is needed, with the scan plan.
        """
        new = NewPart(name=name, expected=expected.strip(), database=database, job=job, touch=touch)
        with intake.work_folder() as folder:
            check_count(len(photo or ()))
            sent = [
                await receive(upload, "photo", folder, number=n) for n, upload in enumerate(photo or (), 1)
            ]
            sent += [await receive(scan, "scan", folder)] if scan is not None else []
            key = _idempotency(request, caller, idempotency_key, sent, *vars(new).values())
            done = await intake.receive(new, sent, idempotency=key, call=await _touch_call(request))
        return replied(done, 201)

    @router.post("/parts/{part_id}/scan", response_model=PartAnswer)
    async def add_scan(
        request: Request,
        part_id: PartId,
        scan: Scan,
        idempotency_key: Key = None,
        caller: Caller = Writes,
    ) -> Response:
        """Add a scan; the answer is the fused reading."""
        with intake.work_folder() as folder:
            scanned = await receive(scan, "scan", folder)
            key = _idempotency(request, caller, idempotency_key, [scanned], part_id)
            done = await intake.add_scan(part_id, scanned, idempotency=key)
        return replied(done, 200)

    def replied(done: Received, status: int) -> Response:
        # encoded here: FastAPI would validate once more what the store has validated
        body = to_json_bytes(answer(done.part, root_path))
        headers = {"Idempotent-Replayed": "true"} if done.replayed else None
        return Response(body, 200 if done.replayed else status, headers, media_type="application/json")

    @router.post("/parts/{part_id}/touch")
    async def touch_part(request: Request, part_id: PartId, caller: Caller = Writes) -> PartAnswer:
        """Release a part that lies under the whiskers: the service's own stage scans it."""
        return answer(await intake.touch(part_id, await _touch_call(request)), root_path)

    @router.post("/parts/{part_id}/review")
    def review_part(part_id: PartId, body: ReviewBody, caller: Caller = Reviews) -> PartAnswer:
        """Confirm or correct what was read."""
        text = check_visible(body.text.strip())
        if body.action is not ReviewAction.UNREADABLE and not text:
            raise Problem(422, "the text is empty; give the serial, or the action unreadable")
        standing = store.part(part_id)
        checked = body.action is not ReviewAction.UNREADABLE and not body.outside_format
        if checked and (against := intake.calls.outside_format(text, standing.job)):
            raise Problem(
                422, f"{text!r}: {against}; if the part reads so, send it with outside_format: true"
            )
        review = {"action": body.action, "text": text, "note": body.note, "before": body.before}
        return answer(intake.review(part_id, caller.person(body.who), **review), root_path)

    @router.delete("/parts/{part_id}/review")
    def undo_review(
        part_id: PartId,
        who: Annotated[str, Query(max_length=100, description="name of the person, without a token")] = "",
        caller: Caller = Reviews,
    ) -> PartAnswer:
        """Undo one's own review: the part waits for review again."""
        return answer(intake.undo_review(part_id, caller.person(who)), root_path)

    @router.get("/parts")
    def list_parts(filters: Annotated[PartPage, Query()], caller: Caller = LooksUp) -> list[PartAnswer]:
        """Parts, newest first.

        A token of the scope write alone gets the parts of one name, which it must give whole.
        """
        reads = Scope.READ in caller.scopes
        if not reads and not folded(filters.name):
            raise Problem(
                403, "the scope write looks up parts by their whole name: give name, or a token to read"
            )
        parts = store.parts(**filters.model_dump(), whole_name=not reads)
        return [answer(part, root_path) for part in parts]

    @router.get(
        "/parts.csv", response_class=StreamingResponse, responses={200: {"content": {"text/csv": {}}}}
    )
    def table(filters: Annotated[PartFilter, Query()], caller: Caller = Reads) -> StreamingResponse:
        """Parts as CSV, newest first."""
        # the first page is read before the answer begins, so that invalid filters are answered with a problem
        first = store.parts(**filters.model_dump(), limit=_AT_ONCE)
        name = f"parts-{datetime.now(UTC):%Y-%m-%d}.csv"
        headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}
        return StreamingResponse(
            _lines(store, filters, first), media_type="text/csv; charset=utf-8", headers=headers
        )

    @router.get("/parts/{part_id}")
    def one_part(part_id: PartId, caller: Caller = LooksUp) -> PartAnswer:
        """A part as it stands."""
        return answer(store.part(part_id), root_path)

    @router.get("/parts/{part_id}/history")
    def history(part_id: PartId, caller: Caller = Reads) -> History:
        """All that happened to a part.

        Where two people must agree, what the first has read is left out until the second has read it.
        """
        story = store.story(part_id)
        reviews = intake.policy.shown(story, caller.person())
        return History(story.events, story.readings, reviews, story.evidence)

    @router.get(
        "/parts/{part_id}/pictures/{picture}",
        response_class=Response,
        responses={200: {"content": {"image/*": {}}}},
    )
    def picture(part_id: PartId, picture: PictureName, caller: Caller = Reads) -> Response:
        """A picture of a part: as photographed, as scanned, or the last reading's with the boxes of its characters."""
        part, evidence = store.part(part_id), store.evidence(part_id)
        reading = part.reading
        if picture != "boxes":
            return _file(files, _last(evidence, PICTURES[picture], part_id))
        if reading is None:
            raise Problem(404, f"the part {part_id} has no reading to draw boxes of")
        record = _last(evidence, PICTURES["photo" if reading.source == "vision" else "edges"], part_id)
        return Response(boxes_picture(_whole(files, record), record.meta, reading), media_type="image/png")

    @router.get(
        "/parts/{part_id}/evidence/{sha256}",
        response_class=Response,
        responses={200: {"content": {"application/octet-stream": {}}}},
    )
    def evidence_file(
        part_id: PartId, sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")], caller: Caller = Reads
    ) -> Response:
        """A file kept for a part."""
        records = [e for e in store.evidence(part_id) if e.sha256 == sha256]
        if not records:
            raise Problem(404, f"the part {part_id} has no such file; its history lists them")
        return _file(files, records[0], download=True)

    return router


async def _touch_call(request: Request) -> TouchCall:
    await request.is_disconnected()  # the server reads on after the body, and so notices the end
    return TouchCall(has_gone=request.is_disconnected)


def _idempotency(
    request: Request, caller: Caller, key: str | None, sent: Sequence[Upload], *fields: str
) -> IdempotencyKey | None:
    if key is None:
        return None
    digest = hashlib.sha256(request.url.path.encode())
    for part in (*(f"{upload.kind} {upload.sha256}" for upload in sent), *fields):
        digest.update(b"\0" + part.encode())
    return IdempotencyKey(f"{caller.token or 'local'}:{key}", digest.hexdigest())


def _last(evidence: Sequence[EvidenceRecord], kind: EvidenceKind, part_id: str) -> EvidenceRecord:
    for record in reversed(evidence):
        if record.kind is kind:
            return record
    raise Problem(404, f"the part {part_id} has no such picture")


def _file(files: EvidenceFolder, record: EvidenceRecord, *, download: bool = False) -> Response:
    return FileResponse(
        _whole(files, record),
        media_type="application/octet-stream" if download else record.media_type,
        filename=(record.name or record.sha256) if download else None,
        headers={"Cache-Control": _LASTING, "ETag": f'"{record.sha256}"'},
    )


def _whole(files: EvidenceFolder, record: EvidenceRecord) -> FilePath:
    what = record.kind.value
    if record.gone:
        raise Problem(404, f"the {what} is no longer kept; its time was up")
    for path in files.whole((record.sha256,)):
        return path
    if files.state(record.sha256, read=False) is FileState.MISSING:
        raise Problem(404, f"the {what} is missing from the service's folder; restore it from a backup")
    raise Problem(500, f"the {what} is damaged on the service's disk; restore it from a backup")


def _lines(store: Store, filters: PartFilter, page: tuple[PartRecord, ...]) -> Iterator[str]:
    yield CSV_BEGIN + csv_line(COLUMNS)
    while page:
        yield "".join(csv_line(_cell(part, path) for path in COLUMNS.values()) for part in page)
        page = store.parts(**filters.model_dump(), before=page[-1].id, limit=_AT_ONCE) if page else ()


def _cell(value: Any, path: str) -> str:
    for name in path.split("."):
        value = None if value is None else getattr(value, name)
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
