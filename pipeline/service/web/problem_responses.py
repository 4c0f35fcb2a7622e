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
# FileError: of the service's own files; faults of files that were sent are Problems already
_EXPECTED = (Problem, StoreError, FileError, OSError, RequestValidationError, HTTPException)
log = structlog.get_logger("tactile-marks")


def add_problem_handlers(app: FastAPI) -> None:
    """Have the application answer what it and the store raise."""

    async def answer(request: Request, error: Exception) -> Response:
        return problem_answer(problem_of(error, request), request.scope)

    for kind in _EXPECTED:
        app.add_exception_handler(kind, answer)


def problem_of(error: BaseException, request: Request) -> Problem:
    """The answer to an expected error."""
    if isinstance(error, Problem):
        return error
    if isinstance(error, StoreError):
        for kind, status in _STATUSES.items():
            if isinstance(error, kind):
                return Problem(status, str(error))
        log.error("store", why=str(error))
        # do not disclose its address, least of all to callers without a token
        return OwnProblem("the store does not answer; the service's log says why")
    if isinstance(error, RequestValidationError):
        first = error.errors()[0]
        where = ".".join(str(at) for at in first["loc"] if at not in ("body", "query", "path", "header"))
        return Problem(422, f"{where or 'the request'}: {first['msg'][:1].lower()}{first['msg'][1:]}")
    if not isinstance(error, HTTPException):
        return no_room(error)
    if isinstance(error.__cause__, Problem | OSError):  # the upload has stalled, or could not be put down
        return problem_of(error.__cause__, request)
    detail = str(error.detail)
    if error.status_code == 404:
        detail = f"there is nothing at {request.url.path[:200]}; see /docs for the addresses"
    return Problem(error.status_code, detail, headers=dict(error.headers or {}))
