"""Jobs over HTTP: list them, and write them with the scope to review."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Path, Response
from pydantic import SkipValidation

from pipeline.common.job_file import NAME
from pipeline.common.records import Scope
from pipeline.common.settings import ReadSettings
from pipeline.service.api.answers import may, problems
from pipeline.service.job_edit import written_job
from pipeline.service.job_folder import JobAnswer
from pipeline.service.web.access import Caller
from pipeline.service.web.uploads import SMALL_BODY

if TYPE_CHECKING:
    from pipeline.service.app import Service

JobName = Annotated[str, Path(pattern=f"^{NAME}$", examples=["housing-left"])]
_OVER: dict[int | str, dict[str, Any]] = {
    200: {"model": JobAnswer, "description": "written over the job that was there"}
}


def jobs_router(service: Service) -> APIRouter:
    """The routes of /v1/jobs."""
    router = APIRouter(prefix="/v1", tags=["jobs"], responses=problems(401, 403), max_body_size=SMALL_BODY)
    Reads, Reviews = may(service.access, Scope.READ), may(service.access, Scope.REVIEW)
    jobs = service.jobs

    @router.get("/jobs")
    def list_jobs(caller: Caller = Reads) -> list[JobAnswer]:
        """Jobs that a part may be read by."""
        return jobs.listed()

    @router.get("/jobs/{name}", responses=problems(404, 422))
    def one_job(name: JobName, caller: Caller = Reads) -> JobAnswer:
        """One job."""
        return jobs.answer(name)

    @router.delete("/jobs/{name}", status_code=204, responses=problems(404, 409, 422))
    def delete_job(name: JobName, caller: Caller = Reviews) -> None:
        """Delete a job; parts that were read by it stay as they are."""
        jobs.delete(name)

    @router.put("/jobs/{name}", status_code=201, responses=_OVER | problems(400, 422))
    def write_job(
        response: Response,
        name: JobName,
        body: Annotated[ReadSettings, SkipValidation],  # a worker does it
        caller: Caller = Reviews,
    ) -> JobAnswer:
        """Write a job: settings of reading that hold for the parts that name it.

        A `database` is one that /v1/databases lists; other files are named in the job file itself.
        """
        if not jobs.save(name, written_job(jobs, body)):
            response.status_code = 200
        return jobs.answer(name)

    return router
