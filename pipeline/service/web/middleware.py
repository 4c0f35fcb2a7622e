"""The outermost layer of every request: request id, log line and metrics, and the answer to a failure."""

from __future__ import annotations

import asyncio
import re
import secrets
import time
from dataclasses import asdict
from typing import TYPE_CHECKING
from urllib.parse import quote

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import body_limit
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response

from pipeline.service.web.addresses import relative, without_prefix
from pipeline.service.web.problem import MEDIA_TYPE, Problem, stopping

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from pipeline.service.metrics import Metrics

REQUEST_ID = "x-request-id"
BODY_PATIENCE_S = 30.0
"""Longest pause within an upload, s."""
BODY_MOST_S = 600.0
"""Longest time that a whole upload may take, s, even if data keeps arriving."""
_SANE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_QUIET_ROUTES = ("/healthz", "/readyz", "/metrics", "/static")
log = structlog.get_logger("tactile-marks")


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
    return JSONResponse(
        asdict(problem.body(request_id)), problem.status, headers=problem.headers, media_type=MEDIA_TYPE
    )


class RequestLayer:
    """Give each request an id and a log line, count it in the metrics, and drop stalled uploads.

    HEAD is answered as GET without the body. A proxy's prefix (`root_path`) is removed from the path.
    """

    def __init__(self, app: ASGIApp, *, metrics: Metrics, root_path: str = "") -> None:
        self._app, self._metrics, self._root_path = app, metrics, root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = given if _SANE_ID.fullmatch(given) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        method = scope["method"]
        scope = without_prefix(scope, self._root_path)
        if method == "HEAD":
            scope = {**scope, "method": "GET"}
        start, status, begun = time.perf_counter(), 500, False

        async def send_with_headers(message: Message) -> None:
            nonlocal status, begun
            if message["type"] == "http.response.start":
                status, begun = message["status"], True
                headers = MutableHeaders(scope=message)
                headers[REQUEST_ID] = request_id
                headers.setdefault("x-content-type-options", "nosniff")
                headers.setdefault("cache-control", "no-store")
            elif method == "HEAD":
                message = {**message, "body": b""}
            await send(message)

        with structlog.contextvars.bound_contextvars(request=request_id):
            try:
                await self._app(scope, _with_timeouts(receive), send_with_headers)
            except (Exception, asyncio.CancelledError) as error:
                if type(error).__module__ == body_limit.__name__:
                    raise  # the body is over its limit, which starlette answers with 413
                # a service that stops cancels requests that are not done in time
                problem = error if isinstance(error, Problem) else stopping()
                if problem is not error and isinstance(error, Exception):
                    log.exception("request failed", path=scope["path"])
                    problem = Problem(500, f"the service failed; its log says why under {request_id}")
                if begun:
                    raise
                await problem_answer(problem, scope)(scope, receive, send_with_headers)
            finally:
                self._record(scope, method, status, time.perf_counter() - start)
        return None

    def _record(self, scope: Scope, method: str, status: int, seconds: float) -> None:
        route = _route(scope)
        # a caller may invent methods, and each would stay in the metrics for ever
        method = method if method in _METHODS else "other"
        self._metrics.requests.labels(method, route, str(status)).inc()
        self._metrics.request_seconds.labels(route).observe(seconds)
        if not route.startswith(_QUIET_ROUTES):
            log.info(
                "request",
                method=method,
                path=scope["path"][:200],
                status=status,
                seconds=round(seconds, 4),
                client=(scope.get("client") or ("",))[0],
            )


def _route(scope: Scope) -> str:
    """The route's pattern, so that the metrics have few routes whatever path is requested."""
    route = scope.get("route")
    return str(getattr(route, "path_format", None) or getattr(route, "path", None) or "none")


def _with_timeouts(receive: Receive) -> Receive:
    """Limit the wait for each chunk of a body and for all of it; after the last chunk there is no limit."""
    whole, until_s = False, time.monotonic() + BODY_MOST_S

    async def next_message() -> Message:
        nonlocal whole
        if whole:
            return await receive()  # waits for the end of the connection, which may take long
        patience_s = min(BODY_PATIENCE_S, until_s - time.monotonic())
        try:
            message = await asyncio.wait_for(receive(), max(0.0, patience_s))
        except TimeoutError:
            detail = (
                f"no data arrived for {BODY_PATIENCE_S:.0f} s; send it again"
                if patience_s == BODY_PATIENCE_S
                else f"it took longer than {BODY_MOST_S:.0f} s; send it again over a faster connection"
            )
            raise Problem(408, detail, headers={"Connection": "close"}) from None
        whole = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    return next_message
