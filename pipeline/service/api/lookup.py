"""Parts over HTTP, looked up: as they stand, their history, pictures and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response

from pipeline.common.people_records import AuditFigures, Person
from pipeline.common.records import EvidenceKind, EvidenceRecord, History, Scope, Statistics
from pipeline.plots.boxes_picture import boxes_picture
from pipeline.service.api.answers import (
    PICTURES,
    PartAnswer,
    PartId,
    PictureName,
    SoughtPage,
    answer,
    may,
    problems,
)
from pipeline.service.api.examples import HISTORY_EXAMPLE, PART_EXAMPLE, example_answer
from pipeline.service.web.access import Caller
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import SMALL_BODY
from pipeline.store.evidence_folder import EvidenceFolder, FileState

if TYPE_CHECKING:
    from pipeline.service.app import Service

_LASTING = "private, max-age=31536000, immutable"


@dataclass(frozen=True)
class FiguresAnswer(Statistics):
    """The dashboard's numbers.

    Attributes:
        audits: how many of the accepted parts were accepted wrong, by those that people have audited.
    """

    audits: AuditFigures


def lookup_router(service: Service) -> APIRouter:
    """The routes that look up /v1/parts."""
    router = APIRouter(prefix="/v1", responses=problems(401, 403, 422), max_body_size=SMALL_BODY)
    Reads, store, files = may(service.access, Scope.READ), service.store, service.evidence
    root_path = service.settings.root_path

    @router.get("/parts", tags=["parts"])
    def list_parts(sought: Annotated[SoughtPage, Query()], caller: Caller = Reads) -> list[PartAnswer]:
        """Parts, newest first."""
        return [answer(part, root_path) for part in store.parts(**sought.model_dump())]

    @router.get(
        "/parts/{part_id}", tags=["parts"], responses=example_answer(200, part=PART_EXAMPLE) | problems(404)
    )
    def one_part(part_id: PartId, caller: Caller = Reads) -> PartAnswer:
        """A part as it stands."""
        return answer(store.part(part_id), root_path)

    @router.get(
        "/parts/{part_id}/history",
        tags=["parts"],
        responses=example_answer(200, history=HISTORY_EXAMPLE) | problems(404),
    )
    def history(part_id: PartId, caller: Caller = Reads) -> History:
        """All that happened to a part.

        Where two people must agree, what the first has read is left out until the second has read it.
        """
        story = store.story(part_id)
        reviews = service.intake.policy.shown(story, Person(caller.token, token=caller.token))
        return History(story.events, story.readings, reviews, story.evidence)

    @router.get(
        "/parts/{part_id}/pictures/{picture}",
        tags=["parts"],
        response_class=Response,
        responses={200: {"content": {"image/*": {}}}, **problems(404, 500)},
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
        tags=["parts"],
        response_class=Response,
        responses={200: {"content": {"application/octet-stream": {}}}, **problems(404, 500)},
    )
    def evidence_file(
        part_id: PartId, sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")], caller: Caller = Reads
    ) -> Response:
        """A file kept for a part."""
        records = [e for e in store.evidence(part_id) if e.sha256 == sha256]
        if not records:
            raise Problem(404, f"the part {part_id} has no such file; its history lists them")
        return _file(files, records[0], download=True)

    @router.get("/figures", tags=["service"])
    def figures(
        hours: Annotated[float, Query(gt=0.0, le=24.0 * 366, allow_inf_nan=False)] = 24.0,
        caller: Caller = Reads,
    ) -> FiguresAnswer:
        """Reads, fallbacks, rejects, accuracy and times of the last hours."""
        since = datetime.now(UTC) - timedelta(hours=hours)
        return FiguresAnswer(**store.statistics(since).__dict__, audits=store.audit_figures(since))

    return router


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
    """Path of a file that holds what was kept; never one that has changed since."""
    what = record.kind.value
    if record.gone:
        raise Problem(404, f"the {what} is no longer kept; its time was up")
    for path in files.whole((record.sha256,)):
        return path
    if files.state(record.sha256, read=False) is FileState.MISSING:
        raise Problem(404, f"the {what} is missing from the service's folder; restore it from a backup")
    raise Problem(500, f"the {what} is damaged on the service's disk; restore it from a backup")
