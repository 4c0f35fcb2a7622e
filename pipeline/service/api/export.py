"""Parts as a table, for a spreadsheet: sent as it is read, however many there are."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import StreamingResponse

from pipeline.common.records import PartRecord, Scope
from pipeline.common.texts import harmless
from pipeline.service.api.answers import Sought, may, problems
from pipeline.service.web.access import Caller
from pipeline.service.web.uploads import SMALL_BODY
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


def export_router(service: Service) -> APIRouter:
    """The route of the table."""
    router = APIRouter(
        prefix="/v1", tags=["parts"], responses=problems(401, 403, 422), max_body_size=SMALL_BODY
    )
    Reads, store = may(service.access, Scope.READ), service.store

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

    return router


class _Echo:
    """A file that gives back what is written to it, so that a row of a table is the answer of its writer."""

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
