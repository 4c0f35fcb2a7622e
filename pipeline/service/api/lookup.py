"""Parts over HTTP, looked up: as they stand, their history, pictures and files."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response

from pipeline.common.people_records import AuditFigures
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    History,
    PartRecord,
    Scope,
    Statistics,
)
from pipeline.plots.boxes_picture import boxes_picture
from pipeline.service.api.answers import (
    PICTURES,
    TEXT,
    PartAnswer,
    PartFilter,
    PartId,
    PictureName,
    answer,
    checked_id,
    may,
    problems,
)
from pipeline.service.api.examples import HISTORY_EXAMPLE, PART_EXAMPLE
from pipeline.service.part_service import PartService
from pipeline.service.web.access import Access, Caller
from pipeline.service.web.problem import Problem
from pipeline.store.evidence_folder import FileState


@dataclass(frozen=True)
class FiguresAnswer(Statistics):
    """The dashboard's numbers.

    Attributes:
        audits: how many of the accepted parts were accepted wrong, by those that people have audited.
    """

    audits: AuditFigures


def lookup_router(service: PartService, access: Access, *, root_path: str = "") -> APIRouter:
    """The routes that look up /v1/parts; `root_path`: prefix of a proxy, for their links."""
    router = APIRouter(prefix="/v1", tags=["parts"])
    Reads = may(access, Scope.READ)

    @router.get(
        "/parts",
        response_model=list[PartAnswer],
        summary="Parts, newest first",
        responses=problems(401, 403, 422),
    )
    def list_parts(
        sought: PartFilter,
        before: Annotated[
            str | None, Query(max_length=64, pattern=TEXT, description="id after which to go on")
        ] = None,
        limit: Annotated[int, Query(ge=1, le=500)] = 50,
        caller: Caller = Reads,
    ) -> Any:
        parts = service.store.parts(**sought.values(), before=before, limit=limit)
        return [answer(part, root_path) for part in parts]

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
        return answer(service.store.part(checked_id(part_id)), root_path)

    @router.get(
        "/parts/{part_id}/history",
        response_model=History,
        summary="All that happened to a part",
        responses={
            200: {"content": {"application/json": {"example": HISTORY_EXAMPLE}}},
            **problems(401, 403, 404, 422),
        },
    )
    def history(part_id: PartId, caller: Caller = Reads) -> Any:
        store = service.store
        store.part(checked_id(part_id))
        return History(
            store.history(part_id), store.readings(part_id), store.reviews(part_id), store.evidence(part_id)
        )

    @router.get(
        "/parts/{part_id}/pictures/{picture}",
        response_class=Response,
        summary="A picture of a part: as photographed, as scanned, or with the characters' boxes",
        responses={200: {"content": {"image/*": {}}}, **problems(401, 403, 404, 422, 500)},
    )
    def picture(part_id: PartId, picture: PictureName, caller: Caller = Reads) -> Any:
        store = service.store
        part, evidence = store.part(checked_id(part_id)), store.evidence(part_id)
        if picture == "boxes":
            return _boxes(service, part, evidence)
        record = _last(evidence, PICTURES[picture])
        if record is None:
            raise Problem(404, f"the part {part_id} has no picture {picture!r}")
        return _file(service, record)

    @router.get(
        "/parts/{part_id}/evidence/{sha256}",
        response_class=Response,
        summary="A file kept for a part",
        responses={200: {"content": {"application/octet-stream": {}}}, **problems(401, 403, 404, 422, 500)},
    )
    def evidence_file(
        part_id: PartId, sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")], caller: Caller = Reads
    ) -> Any:
        records = [e for e in service.store.evidence(checked_id(part_id)) if e.sha256 == sha256]
        if not records:
            raise Problem(404, f"the part {part_id} has no such file; its history lists them")
        return _file(service, records[0], download=True)

    @router.get(
        "/figures",
        response_model=FiguresAnswer,
        summary="Reads, fallbacks, rejects, accuracy and times of the last hours",
        responses=problems(401, 403, 422),
        tags=["service"],
    )
    def figures(
        hours: Annotated[float, Query(gt=0.0, le=24.0 * 366, allow_inf_nan=False)] = 24.0,
        caller: Caller = Reads,
    ) -> Any:
        since = datetime.now(UTC) - timedelta(hours=hours)
        numbers = service.store.statistics(since)
        return FiguresAnswer(**numbers.__dict__, audits=service.store.audit_figures(since))

    return router


def _last(evidence: tuple[EvidenceRecord, ...], kind: EvidenceKind) -> EvidenceRecord | None:
    return next((e for e in reversed(evidence) if e.kind is kind), None)


def _file(service: PartService, record: EvidenceRecord, *, download: bool = False) -> Response:
    path = _whole(service, record)
    headers = {"Cache-Control": "private, max-age=31536000, immutable", "ETag": f'"{record.sha256}"'}
    if download:
        return FileResponse(
            path,
            media_type="application/octet-stream",
            filename=record.name or record.sha256,
            headers=headers,
        )
    return FileResponse(path, media_type=record.media_type, headers=headers)


def _boxes(service: PartService, part: PartRecord, evidence: tuple[EvidenceRecord, ...]) -> Response:
    """What the last reading was made from, with its characters' boxes drawn in."""
    reading = part.reading
    kind = (
        EvidenceKind.PHOTO_PICTURE
        if reading is not None and reading.source == "vision"
        else EvidenceKind.EDGES_PICTURE
    )
    record = _last(evidence, kind)
    if record is None or reading is None:
        raise Problem(404, f"the part {part.id} has no picture to draw boxes in")
    return Response(boxes_picture(_whole(service, record), record.meta, reading), media_type="image/png")


def _whole(service: PartService, record: EvidenceRecord) -> FilePath:
    """Where a file is that holds what was kept; never one that has changed since."""
    what = record.kind.value
    if record.gone:
        raise Problem(404, f"the {what} is no longer kept; its time was up")
    for path in service.evidence.whole((record.sha256,)):
        return path
    if service.evidence.presence(record.sha256) is FileState.MISSING:
        raise Problem(404, f"the {what} is missing from the service's folder; restore it from a backup")
    raise Problem(500, f"the {what} is damaged on the service's disk; restore it from a backup")
