"""Problems of requests, by RFC 9457: whatever fails becomes one in `problem_of`, for every kind of input."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, RedirectResponse, Response

from glyphs.errors import FileError, MarksError
from glyphs.plain_text import visible
from pipeline.common.names import HiddenCharacterError
from pipeline.store.errors import ConflictError, NotFoundError, StoreError, UnfitError
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from starlette.types import Scope

MEDIA_TYPE = "application/problem+json"
_STATUSES = {NotFoundError: 404, ConflictError: 409, UnfitError: 422, HiddenCharacterError: 422}
log = structlog.get_logger("tactile-marks")


class Problem(Exception):  # noqa: N818 - an answer, more than an exception
    """A request that is answered with a problem."""

    def __init__(self, status: int, detail: str, *, headers: dict[str, str] | None = None) -> None:
        super().__init__(detail)
        self.status, self.detail, self.headers = status, detail, headers or {}

    @property
    def is_final(self) -> bool:
        """Whether only the sender can correct it; otherwise the same request may succeed later."""
        return self.status < 500 and self.status not in (408, 429)


@dataclass(frozen=True)
class ProblemBody:
    """The members of a problem; of the type about:blank the title is the status in words."""

    title: str
    status: int
    detail: str
    request_id: str
    type: str = "about:blank"


_CONTENT = {MEDIA_TYPE: {"schema": {"$ref": f"#/components/schemas/{ProblemBody.__name__}"}}}
# answers to failed requests, as the description of the interface has them
PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"description": what, "content": _CONTENT}
    for status, what in (
        ("4XX", "refused; the detail says why and what to do"),
        ("422", "a file or value that cannot be used; the detail says which and what to do"),
        ("5XX", "a fault of the service; its log says more"),
        (
            "503",
            "not now: the queue is full, or the store does not answer; Retry-After says when to ask again",
        ),
    )
}


def without_folders(text: str) -> str:
    """The text with every absolute path cut down to its last part."""
    return re.sub(r"(?<![\w.:/])/(?:[^/\n;,'\"()]+/)+", "", text)


def stopping() -> Problem:
    """The answer to a request that comes while the service stops, or that is interrupted by it."""
    detail = "the service is stopping; send it again in a moment"
    return Problem(503, detail, headers={"Retry-After": "5", "Connection": "close"})


class OwnProblem(Problem):
    """A file, job or glyph database of the service cannot be used now; what was sent may be sent again later."""

    def __init__(self, detail: str, *, retry_after_s: int = 5) -> None:
        super().__init__(503, detail, headers={"Retry-After": str(retry_after_s)})


class UnreadableProblem(Problem):
    """A file that cannot be read, or at which workers were lost: no part is read from it again by itself."""


class UnverifiableProblem(UnreadableProblem):
    """A text expected of the part that its reader cannot look for; the files may be sound."""


def busy(wait_s: float) -> Problem:
    """The answer while the queue of parts is full."""
    seconds = str(max(1, round(wait_s)))
    detail = f"the queue of parts is full; send it again in {seconds} s"
    return Problem(503, detail, headers={"Retry-After": seconds})


def problem_of(error: BaseException) -> Problem:
    """Turn a failure into a response that shows none of the service's own paths or addresses; log unexpected ones."""
    if isinstance(error, Problem):
        return error
    for kind, status in _STATUSES.items():
        if isinstance(error, kind):
            return Problem(status, str(error))
    if isinstance(error, StageError):
        return OwnProblem(str(error), retry_after_s=30) if error.later else Problem(422, str(error))
    if isinstance(error, StoreError):
        log.error("store", why=str(error))
        return OwnProblem("the store does not answer; the service's log says why")
    # an error of the service's own files: errors of sent files are Problems already
    if isinstance(error, FileError | OSError):
        log.error("files cannot be kept", why=str(error))
        detail = "the service cannot keep what was sent; its log says why; send it again later"
        return OwnProblem(detail, retry_after_s=30)
    log.error("fault of the program", exc_info=error)
    return Problem(500, "the service failed; its log says why")


def add_problem_handlers(app: FastAPI) -> None:
    """Register answers for errors of the application and the store."""

    async def answer(request: Request, error: Exception) -> Response:
        return problem_answer(_problem(error, request.scope), request.scope)

    for kind in (Problem, MarksError, OSError, RequestValidationError, HTTPException):
        app.add_exception_handler(kind, answer)


def _problem(error: BaseException, scope: Scope) -> Problem:
    if isinstance(error, RequestValidationError):
        return Problem(422, _invalid(error.errors()[0]))
    if not isinstance(error, HTTPException):
        return problem_of(error)
    if isinstance(error.__cause__, Problem | OSError):  # the upload has stalled, or could not be stored
        return problem_of(error.__cause__)
    detail = str(error.detail)
    if error.status_code == 404:
        detail = f"there is nothing at {scope['path'][:200]}; see /docs for the addresses"
    return Problem(error.status_code, detail, headers=dict(error.headers or {}))


def _invalid(error: Mapping[str, Any]) -> str:
    place, *path = error["loc"]
    # below the name of a field there are only indices, and names of types
    name = visible(str(path[0])[:200]) if path else f"the {place}"
    match error["type"]:
        case "json_invalid":
            return f"the body is not JSON ({error['ctx']['error']} at character {name}); correct it"
        case "missing":
            return f"{name} is missing; add it"
        case "extra_forbidden":
            what = "parameter" if place == "query" else "field"
            return f"there is no {what} {name!r}; /docs lists them"
        case "string_pattern_mismatch":
            return f"{name} is empty or has a character that is not allowed, such as a control character; correct it"
    return f"{name}: {error['msg'][:1].lower()}{error['msg'][1:]}"


# Addresses are relative to their page, so that they work under any path prefix of a proxy: on
# https://plant.example/marks/review/01JD... the list of parts is ../parts, not /parts.


def to_root(scope: Scope) -> str:
    """The relative path from the requested address to the service's first page: "./", "../", "../../" ..."""
    path = scope.get("raw_path") or scope["path"].encode("utf-8", "surrogateescape")
    return "../" * (path.partition(b"?")[0].count(b"/") - 1) or "./"


def relative(scope: Scope, address: str) -> str:
    """An address of the service, such as /parts, relative to the requested one."""
    return to_root(scope) + address.removeprefix("/")


def problem_answer(problem: Problem, scope: Scope) -> Response:
    """The answer to a failed request: a problem, a page in a browser, or the sign-in if a token is needed."""
    if problem.status == 401 and not scope["path"].startswith("/v1/"):
        path = scope["path"] + (f"?{query}" if (query := scope["query_string"].decode("latin-1")) else "")
        to = f"/login?to={quote(path, safe='')}" if scope["method"] == "GET" else "/login"
        return RedirectResponse(relative(scope, to), status_code=303, headers=problem.headers)
    accepted = Headers(scope=scope).get("accept", "")
    if "text/html" in accepted and "json" not in accepted:
        page: Response = scope["app"].state.problem_page(Request(scope), problem.status, problem.detail)
        page.headers.update(problem.headers)
        return page
    request_id = scope.get("state", {}).get("request_id", "")
    body = ProblemBody(HTTPStatus(problem.status).phrase, problem.status, problem.detail, request_id)
    return JSONResponse(asdict(body), problem.status, headers=problem.headers, media_type=MEDIA_TYPE)
