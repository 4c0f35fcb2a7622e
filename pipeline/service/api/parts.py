"""Parts over HTTP, sent in: read, scanned, reviewed."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, File, Form, Query, Request, Response, UploadFile

from pipeline.common.people_records import Person
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
    checked_id,
    may,
    problems,
)
from pipeline.service.api.examples import PART_EXAMPLE, TOUCH_EXAMPLE
from pipeline.service.part_service import NewPart, PartService, Touch
from pipeline.service.web.access import Access, Caller
from pipeline.service.web.forms import FormRoute
from pipeline.service.web.idempotency import Received
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import SMALL_BODY, Upload, check_count, receive
from pipeline.store.store import IdempotencyKey


def parts_router(service: PartService, access: Access, *, root_path: str = "") -> APIRouter:
    """The routes that add to /v1/parts; `root_path`: prefix of a proxy, for their links."""
    router = APIRouter(prefix="/v1", tags=["parts"], route_class=FormRoute)

    Writes, Reviews = may(access, Scope.WRITE), may(access, Scope.REVIEW)

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
            **problems(400, 401, 403, 413, 415, 422),
        },
    )
    async def read_part(
        request: Request,
        response: Response,
        photo: Annotated[
            list[UploadFile] | None,
            File(
                description="PNG, JPEG, BMP, TIFF, WebP or GIF; several of one part under other lights are "
                "read as one"
            ),
        ] = None,
        scan: Annotated[
            UploadFile | None, File(description="scan (.h5) or height map (.npz, .x3p, .sdf, .sur ...)")
        ] = None,
        name: Name = "",
        expected: Expected = "",
        database: Database = "",
        job: JobName = "",
        touch: Annotated[
            Touch,
            Form(
                description="who feels the part where the camera is unsure: stage, the service's at once; plan, the "
                "sender by the plan in the answer; asked, the service's stage once it is asked to (/touch). Without a "
                "stage a person gets it, unless it is plan"
            ),
        ] = Touch.ASKED,
        idempotency_key: Key = None,
        caller: Caller = Writes,
    ) -> Any:
        new = NewPart(name=name, expected=expected.strip(), database=database, job=job, touch=touch)
        folder = service.evidence.new_work_folder()
        try:
            photos = await _received(photo or [], folder)
            scanned = await receive(scan, "scan", folder) if scan is not None else None
            key = _idempotency(
                request,
                caller,
                idempotency_key,
                (*photos, scanned),
                (name, expected, database, job, touch),
            )
            done = await service.receive(new, photos=photos, scan=scanned, idempotency=key)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return _answered(done, response, root_path)

    @router.post(
        "/parts/{part_id}/scan",
        response_model=PartAnswer,
        summary="Add a scan; the answer is the fused reading",
        responses={
            200: {"content": {"application/json": {"example": PART_EXAMPLE}}},
            **problems(400, 401, 403, 404, 409, 413, 415, 422),
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
        checked_id(part_id)
        folder = service.evidence.new_work_folder()
        try:
            scanned = await receive(scan, "scan", folder)
            key = _idempotency(request, caller, idempotency_key, (scanned,), (part_id,))
            done = await service.add_scan(part_id, scanned, idempotency=key)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return _answered(done, response, root_path)

    @router.post(
        "/parts/{part_id}/touch",
        response_model=PartAnswer,
        summary="Have the service's own stage scan a part that waits for touch",
        max_body_size=SMALL_BODY,
        responses={
            200: {"content": {"application/json": {"example": PART_EXAMPLE}}},
            **problems(401, 403, 404, 409, 422),
        },
    )
    async def touch_part(part_id: PartId, caller: Caller = Writes) -> Any:
        return answer(await service.touch(checked_id(part_id)), root_path)

    @router.post(
        "/parts/{part_id}/review",
        response_model=PartAnswer,
        summary="Confirm or correct what was read",
        max_body_size=SMALL_BODY,
        responses=problems(400, 401, 403, 404, 409, 422),
    )
    def review_part(part_id: PartId, body: ReviewBody, caller: Caller = Reviews) -> Any:
        if body.action is not ReviewAction.UNREADABLE and not body.text.strip():
            raise Problem(422, "the text is empty; give the serial, or the action unreadable")
        if not (caller.token or body.who.strip()):
            raise Problem(422, "who says it? give your name as who")
        standing = service.store.part(checked_id(part_id))
        against = (
            "" if body.outside_format else service.orders.outside_format(body.text.strip(), standing.job)
        )
        if against and body.action is not ReviewAction.UNREADABLE:
            raise Problem(
                422,
                f"{body.text.strip()!r}: {against}; if the part bears it, send it with outside_format: true",
            )
        part = service.review(
            standing.id,
            action=body.action,
            text=body.text.strip(),
            who=caller.token or body.who,
            token=caller.token,
            note=body.note,
            before=body.before,
        )
        return answer(part, root_path)

    @router.delete(
        "/parts/{part_id}/review",
        response_model=PartAnswer,
        summary="Undo one's own review: the part waits for review again",
        responses=problems(401, 403, 404, 409, 422),
    )
    def undo_review(
        part_id: PartId,
        who: Annotated[str, Query(max_length=100, description="the person, where no token is used")] = "",
        caller: Caller = Reviews,
    ) -> Any:
        person = Person(caller.token or who, token=caller.token)
        return answer(service.undo_review(checked_id(part_id), person), root_path)

    return router


async def _received(sent: Sequence[UploadFile], folder: Path) -> tuple[Upload, ...]:
    """The photographs, in the order sent.

    Raises:
        Problem: as `receive`.
    """
    check_count(len(sent))
    return tuple([await receive(one, "photo", folder, number=n) for n, one in enumerate(sent, start=1)])


def _idempotency(
    request: Request,
    caller: Caller,
    key: str | None,
    uploads: tuple[Upload | None, ...],
    fields: tuple[str, ...],
) -> IdempotencyKey | None:
    """The key with whose it is, and a digest of all that was asked."""
    if key is None:
        return None
    digest = hashlib.sha256(request.url.path.encode())
    for part in (*(u.sha256 if u is not None else "-" for u in uploads), *fields):
        digest.update(b"\0" + part.encode())
    return IdempotencyKey(f"{caller.name}:{key}", digest.hexdigest())


def _answered(done: Received, response: Response, root_path: str) -> PartAnswer:
    if done.replayed:
        response.status_code = 200
        response.headers["Idempotent-Replayed"] = "true"
    return answer(done.part, root_path)
