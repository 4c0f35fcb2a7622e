"""The golden part over HTTP: its scans taken in, and what they have shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Form, UploadFile
from fastapi.concurrency import run_in_threadpool

from pipeline.common.golden_record import GoldenRecord
from pipeline.common.records import Scope
from pipeline.service.api.answers import may, problems
from pipeline.service.web.access import Caller
from pipeline.service.web.forms import FormRoute
from pipeline.service.web.uploads import receive

if TYPE_CHECKING:
    from pipeline.service.app import Service


@dataclass(frozen=True)
class GoldenAnswer(GoldenRecord):
    """A scan of the golden part.

    Attributes:
        worn: measures beyond their limits now, and what to do about them.
    """

    worn: tuple[str, ...] = ()


def golden_router(service: Service) -> APIRouter:
    """The routes of /v1/golden."""
    responses = problems(401, 403)
    router = APIRouter(prefix="/v1", tags=["golden part"], route_class=FormRoute, responses=responses)
    Reads, Writes = may(service.access, Scope.READ), may(service.access, Scope.WRITE)
    golden = service.golden

    @router.post("/golden", status_code=201, responses=problems(400, 409, 413, 415, 422))
    async def scan_golden(
        scan: UploadFile,
        reference: Annotated[bool, Form(description="Compare later ones with this one.")] = False,
        caller: Caller = Writes,
    ) -> GoldenAnswer:
        """A scan of the golden part, which shows how the whiskers wear.

        It is no part: it is in no list, no figure and no result. The first one is the reference.
        """
        with service.intake.work_folder() as folder:
            await golden.measure(await receive(scan, "scan", folder), reference=reference)
        return (await run_in_threadpool(golden_scans))[0]

    @router.get("/golden")
    def golden_scans(caller: Caller = Reads) -> list[GoldenAnswer]:
        """Scans of the golden part, the newest first."""
        scans = golden.scans()
        worn = golden.worn(scans) if scans else ()
        return [GoldenAnswer(**scan.__dict__, worn=() if k else worn) for k, scan in enumerate(scans)]

    return router
