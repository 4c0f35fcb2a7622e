"""Parts as a table, for a spreadsheet: sent as it is read, however many there are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from fastapi import APIRouter
from fastapi.responses import StreamingResponse

from pipeline.common.records import PartRecord, Scope
from pipeline.common.texts import harmless
from pipeline.service.api.answers import PartFilter, Sought, may, problems
from pipeline.service.web.access import Access, Caller
from pipeline.store.store import Store

COLUMNS = (
    "id", "name", "received", "state", "serial", "read_by", "decision", "confidence", "expected", "verdict", "line",
    "job", "database", "reviewed_by", "review", "reviewed", "note",
)  # fmt: skip
_AT_ONCE = 500


def export_router(store: Store, access: Access) -> APIRouter:
    """The route of the table."""
    router = APIRouter(prefix="/v1", tags=["parts"])
    Reads = may(access, Scope.READ)

    @router.get(
        "/parts.csv",
        response_class=StreamingResponse,
        summary="Parts as CSV, newest first",
        responses={200: {"content": {"text/csv": {}}}, **problems(401, 403, 422)},
    )
    def table(sought: PartFilter, caller: Caller = Reads) -> Any:
        # the first page is read before anything is answered, so that what cannot be sought is a problem, not a table
        first = store.parts(**sought.values(), limit=_AT_ONCE)
        return StreamingResponse(
            _lines(store, sought, first),
            media_type="text/csv; charset=utf-8",
            headers={
                "Content-Disposition": f'attachment; filename="parts-{datetime.now(UTC):%Y-%m-%d}.csv"',
                "Cache-Control": "no-store",
            },
        )

    return router


def _lines(store: Store, sought: Sought, page: tuple[PartRecord, ...]) -> Iterator[str]:
    yield _written(COLUMNS)
    while page:
        yield "".join(_written(_row(part)) for part in page)
        page = store.parts(**sought.values(), before=page[-1].id, limit=_AT_ONCE)


def _written(cells: tuple[str, ...]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer).writerow([harmless(cell) for cell in cells])
    return buffer.getvalue()


def _row(part: PartRecord) -> tuple[str, ...]:
    read, review = part.reading, part.review
    return (
        part.id,
        part.name,
        _time(part.created_at),
        part.state.value,
        part.text,
        "" if read is None else read.source,
        "" if read is None else read.decision,
        "" if read is None else f"{read.confidence:.6g}",
        part.expected,
        "" if read is None else read.verdict,
        part.line,
        part.job,
        part.database,
        "" if review is None else review.who,
        "" if review is None else review.action.value,
        "" if review is None else _time(review.at),
        "" if review is None else review.note,
    )


def _time(at: datetime | None) -> str:
    return "" if at is None else at.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
