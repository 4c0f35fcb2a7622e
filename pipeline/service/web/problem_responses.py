"""Answer every expected failure with a problem and its status."""

from __future__ import annotations

from dataclasses import asdict
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import quote

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, RedirectResponse, Response

from glyphs.errors import MarksError
from pipeline.service.web.addresses import relative
from pipeline.service.web.problem import MEDIA_TYPE, Problem, ProblemBody, problem_of

if TYPE_CHECKING:
    from starlette.types import Scope

_EXPECTED = (Problem, MarksError, OSError, RequestValidationError, HTTPException)


def add_problem_handlers(app: FastAPI) -> None:
    """Have the application answer what it and the store raise."""

    async def answer(request: Request, error: Exception) -> Response:
        return problem_answer(_problem(error, request.scope), request.scope)

    for kind in _EXPECTED:
        app.add_exception_handler(kind, answer)


def _problem(error: BaseException, scope: Scope) -> Problem:
    """The answer to an error, also to one of the web framework."""
    if isinstance(error, RequestValidationError):
        first = error.errors()[0]
        where = ".".join(str(at) for at in first["loc"] if at not in ("body", "query", "path", "header"))
        return Problem(422, f"{where or 'the request'}: {first['msg'][:1].lower()}{first['msg'][1:]}")
    if not isinstance(error, HTTPException):
        return problem_of(error)
    if isinstance(error.__cause__, Problem | OSError):  # the upload has stalled, or could not be put down
        return problem_of(error.__cause__)
    detail = str(error.detail)
    if error.status_code == 404:
        detail = f"there is nothing at {scope['path'][:200]}; see /docs for the addresses"
    return Problem(error.status_code, detail, headers=dict(error.headers or {}))


def problem_answer(problem: Problem, scope: Scope) -> Response:
    """The answer to a failed request: a problem, a page in a browser, or the sign-in if a token is needed."""
    if problem.status == 401 and not scope["path"].startswith("/v1/"):
        path = scope["path"] + (f"?{query}" if (query := scope["query_string"].decode("latin-1")) else "")
        to = f"/login?to={quote(path, safe='')}" if scope["method"] == "GET" else "/login"
        return RedirectResponse(relative(scope, to), status_code=303, headers=problem.headers)
    accepted = Headers(scope=scope).get("accept", "")
    page = getattr(scope["app"].state, "problem_page", None) if "app" in scope else None
    if page is not None and "text/html" in accepted and "json" not in accepted:
        made: Response = page(Request(scope), problem.status, problem.detail)
        made.headers.update(problem.headers)
        return made
    request_id = scope.get("state", {}).get("request_id", "")
    body = ProblemBody(HTTPStatus(problem.status).phrase, problem.status, problem.detail, request_id)
    return JSONResponse(asdict(body), problem.status, headers=problem.headers, media_type=MEDIA_TYPE)
