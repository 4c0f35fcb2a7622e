"""The HTTP interface beside the parts: health, figures, jobs, databases and the golden part."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Form, Path, Query, Response, UploadFile
from fastapi.concurrency import run_in_threadpool
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import SkipValidation

from pipeline.common.golden_record import GoldenRecord
from pipeline.common.job_file import NAME
from pipeline.common.people_records import AuditFigures
from pipeline.common.records import Scope, Statistics
from pipeline.common.settings import ReadSettings
from pipeline.service.api import caller_with
from pipeline.service.jobs import JobAnswer, written_job
from pipeline.service.web.access import Caller
from pipeline.service.web.problem import PROBLEMS, Problem
from pipeline.service.web.uploads import FormRoute, receive

if TYPE_CHECKING:
    from pipeline.service.app import Service

JobOfPath = Annotated[str, Path(pattern=f"^{NAME}$", examples=["housing-left"])]
_OVER: dict[int | str, dict[str, Any]] = {
    200: {"model": JobAnswer, "description": "written over the job that was there"}
}


@dataclass(frozen=True)
class FiguresAnswer(Statistics):
    """The dashboard's numbers, with an estimate of the accepted parts that were accepted wrong, from audits."""

    audits: AuditFigures


@dataclass(frozen=True)
class GoldenAnswer(GoldenRecord):
    """A scan of the golden part, with the measures that are beyond their limits now, and what to do about them."""

    worn: tuple[str, ...] = ()


def service_router(service: Service) -> APIRouter:
    """The routes; the first three need no token."""
    router = APIRouter(route_class=FormRoute, responses=PROBLEMS)
    Reads, Writes, Reviews = (caller_with(service.access, scope) for scope in Scope)
    store, jobs, golden = service.store, service.jobs, service.golden

    @router.get("/healthz", tags=["service"])
    async def healthz() -> dict[str, str]:
        """Whether the service is alive."""
        return {"status": "alive"}

    @router.get("/readyz", tags=["service"])
    async def readyz() -> dict[str, str]:
        """Whether parts can be read."""
        why, state = await service.readiness()
        if why:
            raise Problem(503, why, headers={"Retry-After": "1"})
        return state

    @router.get(
        "/metrics",
        tags=["service"],
        response_class=Response,
        responses={200: {"content": {"text/plain": {}}}},
    )
    def metrics() -> Response:
        """Numbers for Prometheus."""
        return Response(generate_latest(service.metrics.registry), media_type=CONTENT_TYPE_LATEST)

    @router.get("/v1/databases", tags=["service"])
    def databases(caller: Caller = Reads) -> list[dict[str, Any]]:
        """Glyph databases that a part may be read with."""
        return jobs.databases.listed()

    @router.get("/v1/figures", tags=["service"])
    def figures(
        hours: Annotated[float, Query(gt=0.0, le=24.0 * 366, allow_inf_nan=False)] = 24.0,
        caller: Caller = Reads,
    ) -> FiguresAnswer:
        """Reads, fallbacks, rejects, accuracy and times of the last hours."""
        since = datetime.now(UTC) - timedelta(hours=hours)
        return FiguresAnswer(**store.statistics(since).__dict__, audits=store.audit_figures(since))

    @router.get("/v1/jobs", tags=["jobs"])
    def list_jobs(caller: Caller = Reads) -> list[JobAnswer]:
        """Jobs that a part may be read by."""
        return jobs.listed()

    @router.get("/v1/jobs/{name}", tags=["jobs"])
    def one_job(name: JobOfPath, caller: Caller = Reads) -> JobAnswer:
        """One job."""
        return jobs.answer(name)

    @router.delete("/v1/jobs/{name}", status_code=204, tags=["jobs"])
    def delete_job(name: JobOfPath, caller: Caller = Reviews) -> None:
        """Delete a job; parts that were read by it stay as they are."""
        jobs.delete(name)

    @router.put("/v1/jobs/{name}", status_code=201, responses=_OVER, tags=["jobs"])
    def write_job(
        response: Response,
        name: JobOfPath,
        body: Annotated[ReadSettings, SkipValidation],  # a worker does it
        caller: Caller = Reviews,
    ) -> JobAnswer:
        """Write a job: settings of reading that hold for the parts that name it.

        A `database` is one that /v1/databases lists; other files are named in the job file itself.
        """
        if not jobs.save(name, written_job(jobs, body)):
            response.status_code = 200
        return jobs.answer(name)

    @router.post("/v1/golden", status_code=201, tags=["golden part"])
    async def scan_golden(
        scan: UploadFile,
        reference: Annotated[bool, Form(description="Compare later scans with this one.")] = False,
        caller: Caller = Writes,
    ) -> GoldenAnswer:
        """A scan of the golden part, which shows how the whiskers wear.

        It is no part: it is in no list, no figure and no result. The first one is the reference.
        """
        with service.intake.work_folder() as folder:
            await golden.measure(await receive(scan, "scan", folder), reference=reference)
        return (await run_in_threadpool(golden_scans))[0]

    @router.get("/v1/golden", tags=["golden part"])
    def golden_scans(caller: Caller = Reads) -> list[GoldenAnswer]:
        """Scans of the golden part, the newest first."""
        scans = golden.scans()
        worn = golden.worn(scans) if scans else ()
        return [GoldenAnswer(**scan.__dict__, worn=() if k else worn) for k, scan in enumerate(scans)]

    return router
