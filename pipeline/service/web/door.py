"""The outermost layer of every request: reject by the head, limit the body's time, count, log, answer failures.

head --> for another host name?            400
     --> of two lengths?                   400
     --> from a page of another site?      403
     --> through a proxy not in settings?  403      (where no token is required: the proxy would let everybody in)
     --> from another user of this machine? a token is required
     --> no valid token?                   401, or the page to sign in
     --> too long, or no room for a part?  413, 503
     --> in; a body that stalls            408
              that is longer than it says  413
"""

from __future__ import annotations

import asyncio
import re
import secrets
import time
from collections.abc import Callable
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import anyio.to_thread
import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, HTTPConnection

from glyphs.plain_text import visible
from pipeline.service.connections import SparingLog
from pipeline.service.web.access import is_in, is_own_user
from pipeline.service.web.problem import Problem, busy, problem_answer, problem_of, stopping

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from pipeline.service.metrics import Metrics
    from pipeline.service.settings import ServiceSettings
    from pipeline.service.web.access import Access

REQUEST_ID = "x-request-id"
# longest pause within an upload, s
BODY_PATIENCE_S = 30.0
# longest time that a whole upload may take, s, even if data keeps arriving
BODY_MOST_S = 600.0
# maximum size of a request without files, bytes
SMALL_BODY = 64_000
# status in the log for a caller who left during an upload, as proxies log it
GONE = 499
_SANE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_METHODS = frozenset({*_SAFE_METHODS, "POST", "PUT", "PATCH", "DELETE"})
_UPLOADS = re.compile("/v1/(?:golden|parts|parts/.*/scan)")
_OPEN = ("/healthz", "/readyz", "/metrics")
_QUIET_ROUTES = (*_OPEN, "/static")
_FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "x-real-ip")
log = structlog.get_logger("tactile-marks")


class Door:
    """Give each request an id, a log line and its place in the metrics, and reject requests before reading the body.

    A page of another site in the operator's browser must not reach the service: neither by forms and scripts nor, if no
    token is required, by a host name of its own that points to this machine. HEAD is answered as GET without body.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        settings: ServiceSettings,
        upload_bytes: int,
        access: Access,
        metrics: Metrics,
        busy: Callable[[], float | None],
    ) -> None:
        """`upload_bytes`: largest request with files. `busy`: seconds until there is room for a part, if none is."""
        self._upload_bytes = upload_bytes
        self._app, self._settings, self._access, self._metrics = app, settings, access, metrics
        self._busy = busy
        self._hosts = _host_names(settings)
        self._log = SparingLog("web interface")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        sent_id = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = sent_id if _SANE_ID.fullmatch(sent_id) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        method = scope["method"]
        scope = _without_prefix(scope, self._settings.root_path)
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
                await self._check_head(scope)
                await self._app(scope, _with_limits(receive, self._most_bytes(scope)), send_with_headers)
            except ClientDisconnect:
                status = GONE
            except (Exception, asyncio.CancelledError) as error:
                # a service that stops cancels requests that are not done in time
                problem = problem_of(error) if isinstance(error, Exception) else stopping()
                if begun:
                    raise
                problem.headers["Connection"] = "close"  # the body may stay unread
                await problem_answer(problem, scope)(scope, receive, send_with_headers)
            finally:
                self._record(scope, method, status, time.perf_counter() - start)
        return None

    async def _check_head(self, scope: Scope) -> None:
        state, headers, path = scope["state"], Headers(scope=scope), scope["path"]
        self._check_host(headers.get("host", ""))
        if "transfer-encoding" in headers and "content-length" in headers:  # a proxy may take the other one
            raise Problem(
                400, "the request has both a Content-Length and a Transfer-Encoding; send one of them"
            )
        self._check_origin(scope, headers)
        if not self._access.required:
            state["other_user"] = await self._is_other_user(scope, headers)
        connection = HTTPConnection(scope)
        # pages that are only looked at redirect to the sign-in themselves
        changes = scope["method"] not in _SAFE_METHODS and path != "/login"
        needs_token = self._access.needs_token(connection) and (changes or path.startswith("/v1/"))
        if needs_token or (path == "/metrics" and any(name in headers for name in _FORWARDED)):
            state["token"] = await anyio.to_thread.run_sync(self._access.token_of, connection)
        length = headers.get("content-length", "0")
        if length.isdigit() and int(length) > self._most_bytes(scope):
            raise _too_large(self._most_bytes(scope))
        if _is_upload(scope) and (wait_s := self._busy()) is not None:
            self._metrics.refused.inc()
            raise busy(wait_s)

    def _most_bytes(self, scope: Scope) -> int:
        return self._upload_bytes if _is_upload(scope) else SMALL_BODY

    def _check_host(self, host: str) -> None:
        name = re.sub(r":\d*$", "", host).strip("[]").lower()
        if not any(fnmatchcase(name, known) for known in self._hosts):
            what = (
                f"the request is for the host name {visible(name[:80])!r}, which is not one of the service's"
            )
            self._log.say(f"host {name}", f"{what}: see hosts")
            raise Problem(400, f"{what}; call it by its address, or name it in the setting hosts")

    def _check_origin(self, scope: Scope, headers: Headers) -> None:
        site, origin = headers.get("sec-fetch-site"), headers.get("origin")
        if scope["method"] in _SAFE_METHODS or site in ("same-origin", "none"):
            return
        same_host = origin is None or origin.partition("://")[2].lower() == headers.get("host", "").lower()
        if site is not None or not same_host:
            raise Problem(403, "the request comes from a page of another site")

    async def _is_other_user(self, scope: Scope, headers: Headers) -> bool:
        client, server = scope.get("client") or ("", 0), scope.get("server")
        if any(name in headers for name in _FORWARDED):
            if is_in(client[0], self._settings.trusted_proxies):
                return False
            raise Problem(
                403,
                "the request comes through a proxy, and the service asks for no token: everybody whom the proxy lets "
                'in could use it; set tokens = "on", or name the proxy\'s address in trusted_proxies',
            )
        if not self._access.own_user or server is None or scope["path"] in _OPEN:
            return False
        connection = scope["state"].get("connection", {})
        if "other_user" not in connection:  # once for all requests of a connection
            own_user = await anyio.to_thread.run_sync(is_own_user, tuple(client), tuple(server))
            connection["other_user"] = not own_user
        return bool(connection["other_user"])

    def _record(self, scope: Scope, method: str, status: int, seconds: float) -> None:
        # the route's pattern, so that the metrics have few routes whatever path is requested
        matched = scope.get("route")
        route = str(getattr(matched, "path_format", None) or getattr(matched, "path", None) or "none")
        # callers may invent methods, and each would stay in the metrics
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


def _host_names(settings: ServiceSettings) -> tuple[str, ...]:
    if settings.tokens_asked and not settings.hosts:
        return ("*",)
    names = (*settings.hosts, settings.host, "localhost", "127.0.0.1", "::1")
    return tuple(name.strip("[]").lower() for name in names)


def _is_upload(scope: Scope) -> bool:
    return scope["method"] == "POST" and _UPLOADS.fullmatch(scope["path"]) is not None


def _too_large(most_bytes: int) -> Problem:
    todo = (
        "only parts are sent with files" if most_bytes == SMALL_BODY else "crop it, or send heights as .npz"
    )
    return Problem(413, f"the request is over the limit of {most_bytes / 1e6:g} MB; {todo}")


def _without_prefix(scope: Scope, root_path: str) -> Scope:
    if not root_path or not f"{scope['path']}/".startswith(f"{root_path}/"):
        return scope
    n = len(root_path)
    inner: dict[str, Any] = {**scope, "path": scope["path"][n:] or "/"}
    raw = scope.get("raw_path")
    if raw is not None and raw.startswith(root_path.encode()):
        inner["raw_path"] = raw[n:] or b"/"
    return inner


def _with_limits(receive: Receive, most_bytes: int) -> Receive:
    """Limit a body's size, the wait for each chunk, and the whole time; after the last chunk there is no limit."""
    whole, n_bytes, until_s = False, 0, time.monotonic() + BODY_MOST_S

    async def next_message() -> Message:
        nonlocal whole, n_bytes
        if whole:
            return await receive()  # waits for the end of the connection, which may take long
        try:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:  # a body that never pauses ends, too
                raise TimeoutError
            async with asyncio.timeout(min(BODY_PATIENCE_S, left_s)):
                message = await receive()
        except TimeoutError:
            detail = (
                f"the upload paused for {BODY_PATIENCE_S:.0f} s or took longer than {BODY_MOST_S:.0f} s; send it "
                "again, over a faster connection if there is one"
            )
            raise Problem(408, detail, headers={"Connection": "close"}) from None
        n_bytes += len(message.get("body", b""))
        if n_bytes > most_bytes:
            raise _too_large(most_bytes)
        whole = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    return next_message
