"""Parts over HTTP: sent in, felt, looked up, reviewed."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, File, Form, Header, Path, Query, Request, Response, UploadFile
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field

from pipeline.access import Access, Caller
from pipeline.boxes_picture import boxes_picture
from pipeline.desk import Desk, NewPart, Received
from pipeline.part_id import is_part_id
from pipeline.problem import MEDIA_TYPE, Problem, ProblemBody
from pipeline.records import (
    EventRecord,
    EvidenceKind,
    EvidenceRecord,
    Figures,
    PartRecord,
    PartState,
    ReadingRecord,
    ReviewAction,
    ReviewRecord,
    Scope,
)
from pipeline.route_examples import HISTORY_EXAMPLE, PART_EXAMPLE, TOUCH_EXAMPLE
from pipeline.store import Idempotency
from pipeline.uploads import Upload, receive

_PROBLEMS = {
    400: "not understood",
    401: "no token, or one that does not hold",
    403: "the token does not allow it",
    404: "no such part, picture or database",
    409: "not as the part stands",
    413: "over the limit of size",
    415: "files of this kind are not read",
    422: "a file or value that cannot be used; the detail names it and the mend",
    503: "as many parts wait as may; the header Retry-After tells when to ask again",
}
PICTURES = {
    "photo": EvidenceKind.PHOTO_PICTURE,
    "edges": EvidenceKind.EDGES_PICTURE,
    "sight-edges": EvidenceKind.SIGHT_EDGES_PICTURE,
}
PictureName = Literal["photo", "edges", "sight-edges", "boxes"]


@dataclass(frozen=True)
class PartAnswer(PartRecord):
    """A part as it stands, and where more of it is to be had.

    Attributes:
        links: addresses of the part, its history, and of its pictures by name.
    """

    links: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class HistoryAnswer:
    """All that happened to a part, oldest first; nothing of it is ever changed."""

    events: tuple[EventRecord, ...]
    readings: tuple[ReadingRecord, ...]
    reviews: tuple[ReviewRecord, ...]
    evidence: tuple[EvidenceRecord, ...]


class ReviewBody(BaseModel):
    """What a person says of a part."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"action": "correct", "text": "KX407251", "who": "Anna", "before": "KX4O7251"}]
        },
    )

    action: ReviewAction
    text: str = Field(
        default="",
        max_length=200,
        pattern=r"^[^\x00-\x1f\x7f]*$",
        description="the serial as it is; empty for unreadable",
    )
    who: str = Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")
    note: str = Field(default="", max_length=2000, pattern=r"^[^\x00]*$")
    before: str | None = Field(
        default=None,
        max_length=200,
        description="the text as it was seen; if it has changed since, the answer is 409",
    )


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The problems of a route, for the description of the interface."""
    return {
        status: {"description": _PROBLEMS[status], "content": {MEDIA_TYPE: {"schema": _PROBLEM_SCHEMA}}}
        for status in statuses
    }


_PROBLEM_SCHEMA = {"$ref": f"#/components/schemas/{ProblemBody.__name__}"}
_TEXT = r"^[^\x00-\x1f\x7f]*$"
Name = Annotated[
    str,
    Form(
        max_length=200, pattern=_TEXT, description="what the line calls the part", examples=["tray-7/part-3"]
    ),
]
Expected = Annotated[
    str,
    Form(
        max_length=200,
        pattern=_TEXT,
        description="the serial it should bear: confirmed, refuted or undecided",
    ),
]
Database = Annotated[
    str, Form(max_length=200, pattern=_TEXT, description="glyph database, as /v1/databases lists them")
]
PartId = Annotated[
    str, Path(max_length=64, description="of the part", examples=["01JD8Z6Y3Q5V7W9X1B2C3D4E5F"])
]
Key = Annotated[
    str | None,
    Header(
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="made by the sender for each part; a request that is sent again with it makes no second part",
    ),
]


def parts_router(desk: Desk, access: Access) -> APIRouter:
    """The routes under /v1/parts."""
    router = APIRouter(prefix="/v1", tags=["parts"])

    def may(scope: Scope) -> Any:
        def check(request: Request) -> Caller:
            return access.caller(request, scope)

        return Depends(check)

    Reads, Writes, Reviews = may(Scope.READ), may(Scope.WRITE), may(Scope.REVIEW)

    def found(part_id: str) -> str:
        if not is_part_id(part_id):
            raise Problem(404, f"there is no part {part_id[:64]!r}; /v1/parts lists them")
        return part_id

    @router.post(
        "/parts",
        status_code=201,
        response_model=PartAnswer,
        summary="Read a part from its photograph, its scan, or both",
        responses={
            201: {
                "description": "read, or touch needed with the scan plan",
                "content": {
                    "application/json": {
                        "examples": {
                            "accepted": {"summary": "the camera is sure", "value": PART_EXAMPLE},
                            "touch_needed": {"summary": "the camera is unsure", "value": TOUCH_EXAMPLE},
                        }
                    }
                },
            },
            200: {
                "model": PartAnswer,
                "description": "the same request was answered before; the part as it stands",
            },
            **problems(400, 401, 403, 413, 415, 422, 503),
        },
    )
    async def read_part(
        request: Request,
        response: Response,
        photo: Annotated[UploadFile | None, File(description="PNG, JPEG, BMP or TIFF")] = None,
        scan: Annotated[
            UploadFile | None, File(description="scan (.h5) or height map (.npz, .x3p, .sdf, .sur ...)")
        ] = None,
        name: Name = "",
        expected: Expected = "",
        database: Database = "",
        touch: Annotated[
            Literal["plan", "stage"],
            Form(
                description="where the camera is unsure: tell the plan, or have the service's stage feel the part"
            ),
        ] = "plan",
        idempotency_key: Key = None,
        caller: Caller = Writes,
    ) -> Any:
        new = NewPart(name=name, expected=expected.strip(), database=database, touch=touch == "stage")
        folder = desk.evidence.new_work_folder()
        try:
            seen = await receive(photo, "photo", folder) if photo is not None else None
            felt = await receive(scan, "scan", folder) if scan is not None else None
            key = _idempotency(
                request, caller, idempotency_key, (seen, felt), (name, expected, database, touch)
            )
            done = await desk.receive(new, photo=seen, scan=felt, idempotency=key)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return _answered(done, response)

    @router.post(
        "/parts/{part_id}/scan",
        response_model=PartAnswer,
        summary="Add what was felt; the answer is the fused reading",
        responses={
            200: {"content": {"application/json": {"example": PART_EXAMPLE}}},
            **problems(400, 401, 403, 404, 409, 413, 415, 422, 503),
        },
    )
    async def add_scan(
        request: Request,
        response: Response,
        part_id: PartId,
        scan: Annotated[
            UploadFile, File(description="scan (.h5) or height map (.npz, .x3p, .sdf, .sur ...)")
        ],
        idempotency_key: Key = None,
        caller: Caller = Writes,
    ) -> Any:
        found(part_id)
        folder = desk.evidence.new_work_folder()
        try:
            felt = await receive(scan, "scan", folder)
            key = _idempotency(request, caller, idempotency_key, (felt,), (part_id,))
            done = await desk.add_scan(part_id, felt, idempotency=key)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return _answered(done, response)

    @router.post(
        "/parts/{part_id}/touch",
        response_model=PartAnswer,
        summary="Have the service's own stage feel a part that waits for touch",
        responses={
            200: {"content": {"application/json": {"example": PART_EXAMPLE}}},
            **problems(401, 403, 404, 409, 422, 503),
        },
    )
    async def touch_part(part_id: PartId, caller: Caller = Writes) -> Any:
        return _answer(await desk.touch(found(part_id)))

    @router.post(
        "/parts/{part_id}/review",
        response_model=PartAnswer,
        summary="Confirm or correct what was read",
        responses=problems(400, 401, 403, 404, 409, 422),
    )
    def review_part(part_id: PartId, body: ReviewBody, caller: Caller = Reviews) -> Any:
        if body.action is not ReviewAction.UNREADABLE and not body.text.strip():
            raise Problem(422, "the text is empty; give the serial, or the action unreadable")
        part = desk.say(
            found(part_id),
            action=body.action,
            text=body.text.strip(),
            who=body.who,
            token=caller.name,
            note=body.note,
            before=body.before,
        )
        return _answer(part)

    @router.get(
        "/parts",
        response_model=list[PartAnswer],
        summary="Parts, newest first",
        responses=problems(401, 403, 422),
    )
    def list_parts(
        state: PartState | None = None,
        text: Annotated[str, Query(max_length=200, pattern=_TEXT, description="that its serial holds")] = "",
        name: Annotated[str, Query(max_length=200, pattern=_TEXT, description="that its name holds")] = "",
        before: Annotated[
            str | None, Query(max_length=64, pattern=_TEXT, description="id after which to go on")
        ] = None,
        limit: Annotated[int, Query(ge=1, le=500)] = 50,
        caller: Caller = Reads,
    ) -> Any:
        parts = desk.store.parts(state=state, text=text, name=name, before=before, limit=limit)
        return [_answer(part) for part in parts]

    @router.get(
        "/parts/{part_id}",
        response_model=PartAnswer,
        summary="A part as it stands",
        responses={
            200: {"content": {"application/json": {"example": PART_EXAMPLE}}},
            **problems(401, 403, 404, 422),
        },
    )
    def one_part(part_id: PartId, caller: Caller = Reads) -> Any:
        return _answer(desk.store.part(found(part_id)))

    @router.get(
        "/parts/{part_id}/history",
        response_model=HistoryAnswer,
        summary="All that happened to a part",
        responses={
            200: {"content": {"application/json": {"example": HISTORY_EXAMPLE}}},
            **problems(401, 403, 404, 422),
        },
    )
    def history(part_id: PartId, caller: Caller = Reads) -> Any:
        store = desk.store
        store.part(found(part_id))
        return HistoryAnswer(
            store.history(part_id), store.readings(part_id), store.reviews(part_id), store.evidence(part_id)
        )

    @router.get(
        "/parts/{part_id}/pictures/{picture}",
        response_class=Response,
        summary="A picture of a part: as photographed, as felt, the camera's edges, or with the characters' boxes",
        responses={200: {"content": {"image/*": {}}}, **problems(401, 403, 404, 422)},
    )
    def picture(part_id: PartId, picture: PictureName, caller: Caller = Reads) -> Any:
        store = desk.store
        part, evidence = store.part(found(part_id)), store.evidence(part_id)
        if picture == "boxes":
            return _boxes(desk, part, evidence)
        record = _last(evidence, PICTURES[picture])
        if record is None:
            raise Problem(404, f"the part {part_id} has no picture {picture!r}")
        return _file(desk, record)

    @router.get(
        "/parts/{part_id}/evidence/{sha256}",
        response_class=Response,
        summary="A file kept for a part",
        responses={200: {"content": {"application/octet-stream": {}}}, **problems(401, 403, 404, 422)},
    )
    def evidence_file(
        part_id: PartId, sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")], caller: Caller = Reads
    ) -> Any:
        records = [e for e in desk.store.evidence(found(part_id)) if e.sha256 == sha256]
        if not records:
            raise Problem(404, f"the part {part_id} has no such file; its history lists them")
        return _file(desk, records[0], download=True)

    @router.get(
        "/figures",
        response_model=Figures,
        summary="Reads, fallbacks, rejects, accuracy and times of the last hours",
        responses=problems(401, 403, 422),
        tags=["service"],
    )
    def figures(
        hours: Annotated[float, Query(gt=0.0, le=24.0 * 366, allow_inf_nan=False)] = 24.0,
        caller: Caller = Reads,
    ) -> Any:
        from datetime import UTC, datetime, timedelta

        return desk.store.figures(datetime.now(UTC) - timedelta(hours=hours))

    return router


def _idempotency(
    request: Request,
    caller: Caller,
    key: str | None,
    uploads: tuple[Upload | None, ...],
    fields: tuple[str, ...],
) -> Idempotency | None:
    """The key with whose it is, and a digest of all that was asked."""
    if key is None:
        return None
    digest = hashlib.sha256(request.url.path.encode())
    for part in (*(u.sha256 if u is not None else "-" for u in uploads), *fields):
        digest.update(b"\0" + part.encode())
    return Idempotency(f"{caller.name}:{key}", digest.hexdigest())


def _answered(done: Received, response: Response) -> PartAnswer:
    if done.replayed:
        response.status_code = 200
        response.headers["Idempotent-Replayed"] = "true"
    return _answer(done.part)


def _answer(part: PartRecord) -> PartAnswer:
    here = f"/v1/parts/{part.id}"
    links = {"self": here, "history": f"{here}/history"}
    links.update({name: f"{here}/pictures/{name}" for name in (*PICTURES, "boxes")})
    return PartAnswer(**{**part.__dict__, "links": links})


def _last(evidence: tuple[EvidenceRecord, ...], kind: EvidenceKind) -> EvidenceRecord | None:
    return next((e for e in reversed(evidence) if e.kind is kind), None)


def _file(desk: Desk, record: EvidenceRecord, *, download: bool = False) -> Response:
    path = desk.evidence.path(record.sha256)
    if record.gone or not path.is_file():
        raise Problem(404, f"the {record.kind.value} is no longer kept; its time was up")
    headers = {"Cache-Control": "private, max-age=31536000, immutable", "ETag": f'"{record.sha256}"'}
    if download:
        return FileResponse(
            path,
            media_type="application/octet-stream",
            filename=record.name or record.sha256,
            headers=headers,
        )
    return FileResponse(path, media_type=record.media_type, headers=headers)


def _boxes(desk: Desk, part: PartRecord, evidence: tuple[EvidenceRecord, ...]) -> Response:
    """What the last reading was made from, with its characters' boxes drawn in."""
    reading = part.reading
    kind = (
        EvidenceKind.PHOTO_PICTURE
        if reading is not None and reading.source == "vision"
        else EvidenceKind.EDGES_PICTURE
    )
    record = _last(evidence, kind)
    path = None if record is None or record.gone else desk.evidence.path(record.sha256)
    if record is None or reading is None or path is None or not path.is_file():
        raise Problem(404, f"the part {part.id} has no picture to draw boxes in")
    return Response(boxes_picture(path, record.meta, reading), media_type="image/png")
