"""The golden part over HTTP: its scans taken in, and what they have shown."""

from __future__ import annotations

import shutil
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Form, UploadFile
from pydantic import BaseModel, Field

from pipeline.common.golden_record import GoldenRecord
from pipeline.common.records import Scope
from pipeline.service.api.answers import may, problems
from pipeline.service.golden import GoldenPart
from pipeline.service.web.access import Access, Caller
from pipeline.service.web.forms import FormRoute
from pipeline.service.web.uploads import receive
from pipeline.store.evidence_folder import EvidenceFolder


class MeasuredAnswer(BaseModel):
    """A number and its standard deviation."""

    value: float
    sd: float


class GoldenAnswer(BaseModel):
    """A scan of the golden part."""

    at: datetime
    line: str
    reference: bool
    measures: dict[str, MeasuredAnswer]
    worn: list[str] = Field(default=[], description="What is beyond its limit now, and what to do about it.")


def golden_router(golden: GoldenPart, evidence: EvidenceFolder, access: Access) -> APIRouter:
    """The routes of /v1/golden."""
    router = APIRouter(prefix="/v1", tags=["golden part"], route_class=FormRoute)
    Reads, Writes = may(access, Scope.READ), may(access, Scope.WRITE)

    @router.post(
        "/golden",
        response_model=GoldenAnswer,
        status_code=201,
        summary="A scan of the golden part, which shows how the whiskers wear",
        description="It is no part: it is in no list, no figure and no result. The first one is the reference.",
        responses=problems(400, 401, 403, 409, 413, 415, 422),
    )
    async def scan_golden(
        scan: UploadFile,
        reference: Annotated[bool, Form(description="Compare later ones with this one.")] = False,
        caller: Caller = Writes,
    ) -> Any:
        folder = evidence.new_work_folder()
        try:
            await golden.scanned(await receive(scan, "scan", folder), reference=reference)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        scans = golden.scans()
        return _answer(scans[0], golden.worn(scans))

    @router.get(
        "/golden",
        response_model=list[GoldenAnswer],
        summary="What scans of the golden part have shown, the newest first",
        responses=problems(401, 403),
    )
    def golden_scans(caller: Caller = Reads) -> Any:
        scans = golden.scans()
        return [_answer(scan, golden.worn(scans) if k == 0 else ()) for k, scan in enumerate(scans)]

    return router


def _answer(scan: GoldenRecord, worn: tuple[str, ...]) -> GoldenAnswer:
    measures = {name.value: MeasuredAnswer(value=one.value, sd=one.sd) for name, one in scan.measures.items()}
    return GoldenAnswer(
        at=scan.at, line=scan.line, reference=scan.reference, measures=measures, worn=list(worn)
    )
