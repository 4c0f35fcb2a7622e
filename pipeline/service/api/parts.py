"""Send parts over HTTP: read, scan, review."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, File, Form, Query, Request, Response, UploadFile

from pipeline.common.reading_records import to_json_bytes
from pipeline.common.records import ReviewAction, Scope
from pipeline.service.api.answers import (
    Database,
    Expected,
    JobName,
    Key,
    Name,
    PartAnswer,
    PartId,
    ReviewBody,
    answer,
    may,
)
from pipeline.service.intake import NewPart, Received, Touch
from pipeline.service.web.access import Caller
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import SMALL_BODY, FormRoute, Upload, check_count, receive
from pipeline.store.parts import IdempotencyKey

if TYPE_CHECKING:
    from pipeline.service.app import Service

Photos = Annotated[
    list[UploadFile] | None,
    File(
        description="PNG, JPEG, BMP, TIFF, WebP or GIF; several of one part under other lights are read as one"
    ),
]
_SCAN = File(description="scan (.h5) or height map (.npz, .x3p, .sdf, .sur ...)")
Scan = Annotated[UploadFile, _SCAN]
TouchBy = Annotated[
    Touch,
    Form(
        description="who feels the part where the camera is unsure: stage, the service's at once; plan, the sender by "
        "the plan in the answer; asked, the service's stage once it is asked to (/touch). Without a stage a person "
        "gets it, unless it is plan"
    ),
]
_REPLAYED: dict[int | str, dict[str, Any]] = {
    200: {"model": PartAnswer, "description": "the same request was answered before; the part as it stands"}
}


def parts_router(service: Service) -> APIRouter:
    """The routes that add to /v1/parts."""
    router = APIRouter(prefix="/v1", tags=["parts"], route_class=FormRoute)
    Writes, Reviews = may(service.access, Scope.WRITE), may(service.access, Scope.REVIEW)
    intake, root_path = service.intake, service.settings.root_path

    @router.post("/parts", status_code=201, response_model=PartAnswer, responses=_REPLAYED)
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
            sent = [await receive(one, "photo", folder, number=n) for n, one in enumerate(photo or (), 1)]
            sent += [await receive(scan, "scan", folder)] if scan is not None else []
            key = _idempotency(request, caller, idempotency_key, sent, name, expected, database, job, touch)
            done = await intake.receive(new, sent, idempotency=key)
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
        # made here, for of an answer that it makes FastAPI checks again what the store has checked
        made = to_json_bytes(answer(done.part, root_path))
        headers = {"Idempotent-Replayed": "true"} if done.replayed else None
        return Response(made, 200 if done.replayed else status, headers, media_type="application/json")

    @router.post("/parts/{part_id}/touch", max_body_size=SMALL_BODY)
    async def touch_part(part_id: PartId, caller: Caller = Writes) -> PartAnswer:
        """Have the service's own stage scan a part that waits for touch."""
        return answer(await intake.touch(part_id), root_path)

    @router.post("/parts/{part_id}/review", max_body_size=SMALL_BODY)
    def review_part(part_id: PartId, body: ReviewBody, caller: Caller = Reviews) -> PartAnswer:
        """Confirm or correct what was read."""
        text, who = body.text.strip(), caller.token or body.who
        if body.action is not ReviewAction.UNREADABLE and not text:
            raise Problem(422, "the text is empty; give the serial, or the action unreadable")
        standing = service.store.part(part_id)
        checked = body.action is not ReviewAction.UNREADABLE and not body.outside_format
        if checked and (against := intake.calls.outside_format(text, standing.job)):
            raise Problem(
                422, f"{text!r}: {against}; if the part reads so, send it with outside_format: true"
            )
        part = intake.review(
            standing.id,
            action=body.action,
            text=text,
            who=who,
            token=caller.token,
            note=body.note,
            before=body.before,
        )
        return answer(part, root_path)

    @router.delete("/parts/{part_id}/review")
    def undo_review(
        part_id: PartId,
        who: Annotated[str, Query(max_length=100, description="the person, where no token is used")] = "",
        caller: Caller = Reviews,
    ) -> PartAnswer:
        """Undo one's own review: the part waits for review again."""
        return answer(intake.undo_review(part_id, caller.person(who)), root_path)

    return router


def _idempotency(
    request: Request, caller: Caller, key: str | None, sent: Sequence[Upload], *fields: str
) -> IdempotencyKey | None:
    """The key with its owner, and a digest of the whole request."""
    if key is None:
        return None
    digest = hashlib.sha256(request.url.path.encode())
    for part in (*(f"{upload.kind} {upload.sha256}" for upload in sent), *fields):
        digest.update(b"\0" + part.encode())
    return IdempotencyKey(f"{caller.token or 'local'}:{key}", digest.hexdigest())
