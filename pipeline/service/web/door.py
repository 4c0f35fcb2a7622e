"""Reject requests by their head, before a byte of the body is read.

head --> from a page of another site?      403
     --> through a proxy not in settings?  403      (where no token is required: the proxy would let everybody in)
     --> from another user of this machine? a token is required
     --> no valid token?                   401, or the page to sign in
     --> too long, or no room for a part?  413, 503
     --> in
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import anyio.to_thread
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import Response

from pipeline.service.web.access import Access
from pipeline.service.web.middleware import problem_answer
from pipeline.service.web.own_user import is_in, is_own_user
from pipeline.service.web.problem import Problem, busy

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_UPLOADS = re.compile("/v1/(?:golden|parts|parts/.*/scan)")
_OPEN = ("/healthz", "/readyz", "/metrics")
_FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "x-real-ip")


class DoorLayer:
    """Reject requests before reading the body.

    A page of another site that the operator has open must not reach the service through the operator's browser: not by
    a form or script, which is caught here, nor by a name of its own that it lets point here, which Starlette's
    TrustedHostMiddleware catches. Where no token is asked for, nor may a proxy on this machine, which makes the whole
    world look as if it called from here.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        access: Access,
        proxies: Sequence[str],
        busy: Callable[[], float | None],
        refused: Callable[[], Any],
        most_bytes: int,
    ) -> None:
        """Take the rules.

        Args:
            app: the wrapped application.
            access: access control.
            proxies: addresses and networks of proxies that may pass requests on.
            busy: seconds after which to retry, None while there is room.
            refused: called for every rejected upload.
            most_bytes: maximum size of one request, bytes.
        """
        self._app, self._access = app, access
        self._proxies = tuple(ipaddress.ip_network(proxy) for proxy in proxies)
        self._busy, self._refused = busy, refused
        self._most_bytes = most_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Turn a request away, or let it in."""
        if scope["type"] == "http" and (answer := await self._answer(scope)) is not None:
            return await answer(scope, receive, send)
        return await self._app(scope, receive, send)

    async def _answer(self, scope: Scope) -> Response | None:
        """The answer to a rejected request; None if the request is let in."""
        state = scope.setdefault("state", {})
        headers = Headers(scope=scope)
        try:
            self._check_origin(scope, headers)
            if not self._access.required:
                state["other_user"] = await self._is_other_user(scope, headers)
            connection, path = HTTPConnection(scope), scope["path"]
            # pages that are only looked at redirect to the sign-in themselves
            changes = scope["method"] not in _SAFE_METHODS and path != "/login"
            if self._access.asked(connection) and (changes or path.startswith("/v1/")):
                state["token"] = await anyio.to_thread.run_sync(self._access.token_of, connection)
            self._check_room(scope, headers)
        except Problem as refused:
            refused.headers["Connection"] = "close"  # the body stays unread
            return problem_answer(refused, scope)
        return None

    def _check_origin(self, scope: Scope, headers: Headers) -> None:
        """Refuse what a page of another site sends (cross-site request forgery), by what browsers say of it.

        Programs that are no browsers send neither header. Browsers send Sec-Fetch-Site over TLS and to this machine,
        and Origin with every request that may change something.
        """
        site, origin = headers.get("sec-fetch-site"), headers.get("origin")
        if scope["method"] in _SAFE_METHODS or site in ("same-origin", "none"):
            return
        own = origin is None or origin.partition("://")[2].lower() == headers.get("host", "").lower()
        if site is not None or not own:
            raise Problem(403, "the request comes out of a page of another site")

    async def _is_other_user(self, scope: Scope, headers: Headers) -> bool:
        """Whether a program of another user of this machine calls; a proxy must be named in the settings."""
        client, server = scope.get("client") or ("", 0), scope.get("server")
        if any(name in headers for name in _FORWARDED):
            if is_in(client[0], self._proxies):
                return False
            raise Problem(
                403,
                "the request comes through a proxy, and the service asks for no token: everybody whom the proxy lets "
                'in could use it; set tokens = "on", or name the proxy\'s address in trusted_proxies',
            )
        if not self._access.own_user or server is None or scope["path"] in _OPEN:
            return False
        return not await anyio.to_thread.run_sync(is_own_user, tuple(client), tuple(server))

    def _check_room(self, scope: Scope, headers: Headers) -> None:
        if scope["method"] != "POST" or not _UPLOADS.fullmatch(scope["path"]):
            return
        length = headers.get("content-length", "0")
        if length.isdigit() and int(length) > self._most_bytes:
            raise Problem(413, f"the upload is over the limit of {self._most_bytes / 1e6:.0f} MB; crop it")
        if (wait_s := self._busy()) is not None:
            self._refused()
            raise busy(wait_s)
