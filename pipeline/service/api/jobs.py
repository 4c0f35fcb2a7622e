"""Jobs over HTTP: listed, and written by whoever may review."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import APIRouter, Path, Response
from pydantic import SkipValidation

from pipeline.common.job_file import NAME
from pipeline.common.records import Scope
from pipeline.common.settings import ReadSettings
from pipeline.service.api.answers import may, problems
from pipeline.service.job_folder import JobAnswer, JobFolder
from pipeline.service.web.access import Access, Caller
from pipeline.service.web.problem import Problem

_FILES_BY_HAND = "is a file of the service's machine; name it in the job file itself"


def jobs_router(jobs: JobFolder, access: Access) -> APIRouter:
    """The routes of /v1/jobs."""
    router = APIRouter(prefix="/v1", tags=["jobs"])
    Reads, Reviews = may(access, Scope.READ), may(access, Scope.REVIEW)

    @router.get(
        "/jobs",
        response_model=list[JobAnswer],
        summary="Jobs that a part may be read by",
        responses=problems(401, 403),
    )
    def list_jobs(caller: Caller = Reads) -> Any:
        return jobs.listed()

    @router.put(
        "/jobs/{name}",
        response_model=JobAnswer,
        status_code=201,
        summary="Write a job: settings of reading that hold for the parts that name it",
        description="A `database` is one that /v1/databases lists; other files are named in the job file itself.",
        responses={
            200: {"model": JobAnswer, "description": "written over the job that was there"},
            201: {"description": "a new job"},
            **problems(400, 401, 403, 422, 503),
        },
    )
    def write_job(
        response: Response,
        name: Annotated[str, Path(pattern=f"^{NAME}$", examples=["housing-left"])],
        body: Annotated[ReadSettings, SkipValidation],  # a worker does it
        caller: Caller = Reviews,
    ) -> Any:
        settings = jobs.settings_of(body)
        written = settings.model_dump(mode="json", exclude_unset=True)
        if settings.database is not None:
            written["database"] = str(jobs.databases.path(str(settings.database)))
        named = [key for key in ("lexicon", "certificate") if written.get(key) is not None]
        named += [font for font in settings.font if FilePath(font).name != font or "." in font]
        if named:
            raise Problem(422, f"{named[0]} {_FILES_BY_HAND}")
        written = {key: value for key, value in written.items() if value is not None}
        if not jobs.save(name, written):
            response.status_code = 200
        return next(job for job in jobs.listed() if job.name == name)

    return router
