"""Answer every expected failure with a problem and its status."""

from __future__ import annotations

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from glyphs.errors import FileError
from pipeline.service.web.middleware import problem_answer
from pipeline.service.web.problem import OwnProblem, Problem, no_room
from pipeline.store.errors import ConflictError, NotFoundError, StoreError, UnfitError

_STATUSES = {NotFoundError: 404, ConflictError: 409, UnfitError: 422}
log = structlog.get_logger("tactile-marks")


def add_problem_handlers(app: FastAPI) -> None:
    """Have the application answer what it and the store raise."""

    def answer(request: Request, problem: Problem) -> Response:
        return problem_answer(problem, request.scope)

    @app.exception_handler(Problem)
    async def _problem(request: Request, error: Problem) -> Response:
        return answer(request, error)

    @app.exception_handler(StoreError)
    async def _store(request: Request, error: StoreError) -> Response:
        for kind, status in _STATUSES.items():
            if isinstance(error, kind):
                return answer(request, Problem(status, str(error)))
        log.error("store", why=str(error))
        # do not disclose its address, least of all to callers without a token
        return answer(request, OwnProblem("the store does not answer; the service's log says why"))

    @app.exception_handler(FileError)  # faults of uploaded files are reported by the reading orders
    @app.exception_handler(OSError)
    async def _disk(request: Request, error: Exception) -> Response:
        return answer(request, no_room(error))

    @app.exception_handler(RequestValidationError)
    async def _invalid(request: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        where = ".".join(str(at) for at in first["loc"] if at not in ("body", "query", "path", "header"))
        detail = f"{where or 'the request'}: {first['msg'][:1].lower()}{first['msg'][1:]}"
        return answer(request, Problem(422, detail))

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> Response:
        detail = str(error.detail)
        if isinstance(error.__cause__, Problem):  # an upload that has stalled, say
            return answer(request, error.__cause__)
        if isinstance(error.__cause__, OSError):  # the upload could not be put down while it came
            return answer(request, no_room(error.__cause__))
        if error.status_code == 404:
            detail = f"there is nothing at {request.url.path[:200]}; see /docs for the addresses"
        return answer(request, Problem(error.status_code, detail, headers=dict(error.headers or {})))
