"""What lies around every request: its id, its log line, its count, its time, and who may send one at all."""

from __future__ import annotations

import asyncio
import re
import secrets
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse

from pipeline.service.problem import MEDIA_TYPE, Problem, stopping

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from pipeline.service.metrics import Metrics

REQUEST_ID = "x-request-id"
BODY_PATIENCE_S = 30.0
"""The longest silence in the middle of an upload."""
_SANE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_QUIET_ROUTES = ("/healthz", "/readyz", "/metrics", "/static")
log = structlog.get_logger("tactile-marks")


def problem_answer(problem: Problem, request_id: str) -> JSONResponse:
    """The answer to a request that goes wrong."""
    return JSONResponse(
        problem.body(request_id), status_code=problem.status, headers=problem.headers, media_type=MEDIA_TYPE
    )


class RequestLayer:
    """Gives each request an id, a log line and its place in the metrics; drops uploads that have stalled."""

    def __init__(self, app: ASGIApp, *, metrics: Metrics) -> None:
        self._app, self._metrics = app, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = given if _SANE_ID.fullmatch(given) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        start, status, begun = time.perf_counter(), 500, False

        async def sent(message: Message) -> None:
            nonlocal status, begun
            if message["type"] == "http.response.start":
                status, begun = message["status"], True
                headers = MutableHeaders(scope=message)
                headers[REQUEST_ID] = request_id
                headers.setdefault("x-content-type-options", "nosniff")
                headers.setdefault("cache-control", "no-store")
            await send(message)

        with structlog.contextvars.bound_contextvars(request=request_id):
            try:
                await self._app(scope, _patient(receive), sent)
            except Problem as problem:
                if begun:
                    raise
                await problem_answer(problem, request_id)(scope, receive, sent)
            except asyncio.CancelledError:  # the time that requests have when the service stops is up
                if begun:
                    raise
                await problem_answer(stopping(), request_id)(scope, receive, sent)
            except Exception:
                log.exception("request failed", path=scope["path"])
                if begun:
                    raise
                fault = Problem(500, f"the service failed; its log says why under {request_id}")
                await problem_answer(fault, request_id)(scope, receive, sent)
            finally:
                self._record(scope, status, time.perf_counter() - start)
        return None

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        route = _route(scope)
        self._metrics.requests.labels(scope["method"][:10], route, str(status)).inc()
        self._metrics.request_seconds.labels(route).observe(seconds)
        if not route.startswith(_QUIET_ROUTES):
            log.info(
                "request",
                method=scope["method"],
                path=scope["path"][:200],
                status=status,
                seconds=round(seconds, 4),
                client=(scope.get("client") or ("",))[0],
            )


def _route(scope: Scope) -> str:
    """The route's pattern: few of them, whatever is asked for."""
    route = scope.get("route")
    return str(getattr(route, "path_format", None) or getattr(route, "path", None) or "none")


def _patient(receive: Receive) -> Receive:
    """Wait for the next stretch of a body so long and no longer; a body that is whole waits for nothing."""
    whole = False

    async def next_message() -> Message:
        nonlocal whole
        if whole:
            return await receive()  # the end of the connection, which may take its time
        try:
            message = await asyncio.wait_for(receive(), BODY_PATIENCE_S)
        except TimeoutError:
            raise Problem(
                408,
                f"nothing came for {BODY_PATIENCE_S:.0f} s; send it again",
                headers={"Connection": "close"},
            ) from None
        whole = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    return next_message


class DoorLayer:
    """Turns away what needs no look: calls out of pages of other sites, and uploads that have no room.

    Where no token is asked for, a page of another site that the operator has open must not reach the service through
    the operator's browser: not by a form, which is caught here, nor by a name of its own that it lets point here, which
    Starlette's TrustedHostMiddleware catches.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        busy: Callable[[], float | None],
        refused: Callable[[], Any],
        uploads: Callable[[str], bool],
        most_bytes: int,
    ) -> None:
        """Take the rules.

        Args:
            app: what lies within.
            busy: seconds after which to ask again, None while there is room.
            refused: called with every upload turned away.
            uploads: whether a path takes uploads.
            most_bytes: of one request.
        """
        self._app, self._busy, self._refused = app, busy, refused
        self._uploads, self._most_bytes = uploads, most_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Turn a request away, or let it in."""
        if scope["type"] == "http":
            headers = Headers(scope=scope)
            problem = self._problem(scope, headers)
            if problem is not None:
                request_id = scope.get("state", {}).get("request_id", "")
                return await problem_answer(problem, request_id)(scope, receive, send)
        return await self._app(scope, receive, send)

    def _problem(self, scope: Scope, headers: Headers) -> Problem | None:
        origin = headers.get("origin")
        if origin is not None and scope["method"] not in _SAFE_METHODS:
            called_by = urlsplit(origin).netloc.lower()
            if called_by != headers.get("host", "").lower():
                return Problem(403, "the request comes out of a page of another site")
        if scope["method"] == "POST" and self._uploads(scope["path"]):
            length = headers.get("content-length", "0")
            close = {"Connection": "close"}
            if length.isdigit() and int(length) > self._most_bytes:
                most = f"{self._most_bytes / 1e6:.0f} MB"
                return Problem(413, f"the upload is over the limit of {most}; crop it", headers=close)
            wait_s = self._busy()
            if wait_s is not None:
                self._refused()
                seconds = str(max(1, round(wait_s)))
                return Problem(
                    503,
                    f"as many parts wait as may; ask again in {seconds} s",
                    headers={"Retry-After": seconds, **close},
                )
        return None
