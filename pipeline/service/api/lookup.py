"""Look up parts over HTTP: lists, tables for a spreadsheet, one part, its history, pictures and files."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.responses import FileResponse, Response, StreamingResponse

from pipeline.common.records import EvidenceKind, EvidenceRecord, History, PartRecord, Scope
from pipeline.common.texts import harmless
from pipeline.plots.boxes_picture import boxes_picture
from pipeline.service.api.answers import (
    PICTURES,
    PartAnswer,
    PartId,
    PictureName,
    Sought,
    SoughtPage,
    answer,
    may,
)
from pipeline.service.web.access import Caller
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import SMALL_BODY
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.store import Store

if TYPE_CHECKING:
    from pipeline.service.app import Service

COLUMNS = {
    "id": "id", "name": "name", "received": "created_at", "state": "state", "serial": "text",
    "read_by": "reading.source", "decision": "reading.decision", "confidence": "reading.confidence",
    "expected": "expected", "verdict": "reading.verdict", "line": "line", "job": "job", "database": "database",
    "reviewed_by": "review.who", "review": "review.action", "reviewed": "review.at", "note": "review.note",
}  # fmt: skip
"""Columns of the table, and the field of a part's record that fills each."""
_AT_ONCE = 500
_LASTING = "private, max-age=31536000, immutable"


def lookup_router(service: Service) -> APIRouter:
    """The routes that look up /v1/parts."""
    router = APIRouter(prefix="/v1", tags=["parts"], max_body_size=SMALL_BODY)
    Reads, store, files = may(service.access, Scope.READ), service.store, service.evidence
    root_path = service.settings.root_path

    @router.get("/parts")
    def list_parts(sought: Annotated[SoughtPage, Query()], caller: Caller = Reads) -> list[PartAnswer]:
        """Parts, newest first."""
        return [answer(part, root_path) for part in store.parts(**sought.model_dump())]

    @router.get(
        "/parts.csv", response_class=StreamingResponse, responses={200: {"content": {"text/csv": {}}}}
    )
    def table(sought: Annotated[Sought, Query()], caller: Caller = Reads) -> StreamingResponse:
        """Parts as CSV, newest first."""
        # the first page is read before anything is answered, so that what cannot be sought is a problem, not a table
        first = store.parts(**sought.model_dump(), limit=_AT_ONCE)
        name = f"parts-{datetime.now(UTC):%Y-%m-%d}.csv"
        headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}
        return StreamingResponse(
            _lines(store, sought, first), media_type="text/csv; charset=utf-8", headers=headers
        )

    @router.get("/parts/{part_id}")
    def one_part(part_id: PartId, caller: Caller = Reads) -> PartAnswer:
        """A part as it stands."""
        return answer(store.part(part_id), root_path)

    @router.get("/parts/{part_id}/history")
    def history(part_id: PartId, caller: Caller = Reads) -> History:
        """All that happened to a part.

        Where two people must agree, what the first has read is left out until the second has read it.
        """
        story = store.story(part_id)
        reviews = service.intake.policy.shown(story, caller.person())
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
    """Path of a kept file whose content is unchanged."""
    what = record.kind.value
    if record.gone:
        raise Problem(404, f"the {what} is no longer kept; its time was up")
    for path in files.whole((record.sha256,)):
        return path
    if files.state(record.sha256, read=False) is FileState.MISSING:
        raise Problem(404, f"the {what} is missing from the service's folder; restore it from a backup")
    raise Problem(500, f"the {what} is damaged on the service's disk; restore it from a backup")


class _Echo:
    """A file whose `write` returns the text, so that a CSV writer returns its row."""

    def write(self, text: str) -> str:
        return text


def _lines(store: Store, sought: Sought, page: tuple[PartRecord, ...]) -> Iterator[str]:
    writer = csv.writer(_Echo())
    yield writer.writerow(COLUMNS)
    while page:
        rows = ([harmless(_cell(part, path)) for path in COLUMNS.values()] for part in page)
        yield "".join(map(writer.writerow, rows))
        page = store.parts(**sought.model_dump(), before=page[-1].id, limit=_AT_ONCE)


def _cell(value: Any, path: str) -> str:
    for name in path.split("."):
        value = None if value is None else getattr(value, name)
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
