"""The door: who may send a request at all, settled from its head, before a byte of its body is read.

head --> from a page of another site?      403
     --> through a proxy nobody has named? 403      (where no token is asked for: the proxy would let everybody in)
     --> from another user of this machine? a token is asked for
     --> no token that holds?              401, or the page to sign in
     --> too long, or no room for a part?  413, 503
     --> in
"""

from __future__ import annotations

import ipaddress
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import anyio.to_thread
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response

from pipeline.service.web.access import Access, DeniedError, denied_problem
from pipeline.service.web.addresses import relative
from pipeline.service.web.middleware import problem_answer
from pipeline.service.web.own_user import is_own_user
from pipeline.service.web.problem import Problem

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
_SIGNING_IN = "/login"
_OPEN = ("/healthz", "/readyz", "/metrics")
_FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "x-real-ip")
_CLOSE = {"Connection": "close"}
"""With an answer that leaves a body unread."""


class DoorLayer:
    """Turns away what needs no look.

    Where no token is asked for, a page of another site that the operator has open must not reach the service through
    the operator's browser: not by a form, which is caught here, nor by a name of its own that it lets point here, which
    Starlette's TrustedHostMiddleware catches. Nor may a proxy on this machine, which makes the whole world look as
    if it called from here.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        access: Access,
        proxies: Sequence[str],
        busy: Callable[[], float | None],
        refused: Callable[[], Any],
        uploads: Callable[[str], bool],
        most_bytes: int,
    ) -> None:
        """Take the rules.

        Args:
            app: what lies within.
            access: who may call.
            proxies: addresses and networks of proxies that may pass requests on.
            busy: seconds after which to ask again, None while there is room.
            refused: called with every upload turned away.
            uploads: whether a path takes uploads.
            most_bytes: of one request.
        """
        self._app, self._access = app, access
        self._proxies = tuple(ipaddress.ip_network(proxy) for proxy in proxies)
        self._busy, self._refused = busy, refused
        self._uploads, self._most_bytes = uploads, most_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Turn a request away, or let it in."""
        if scope["type"] == "http":
            answer = await self._answer(scope)
            if answer is not None:
                return await answer(scope, receive, send)
        return await self._app(scope, receive, send)

    async def _answer(self, scope: Scope) -> Response | None:
        """What a request that is turned away is answered."""
        state = scope.setdefault("state", {})
        headers = Headers(scope=scope)
        try:
            self._check_origin(scope, headers)
            self._check_proxy(scope, headers)
            if self._access.own_user and not self._access.required:
                state["other_user"] = await self._is_other_user(scope, headers)
            connection = HTTPConnection(scope)
            if self._access.asked(connection) and _needs_token(scope):
                state["token"] = await anyio.to_thread.run_sync(self._access.token_of, connection)
            self._check_room(scope, headers)
        except DeniedError as error:
            if not scope["path"].startswith("/v1/"):
                return RedirectResponse(relative(scope, _SIGNING_IN), status_code=303, headers=_CLOSE)
            problem = denied_problem(error, headers=_CLOSE)
        except Problem as refused:
            problem = refused
        else:
            return None
        return problem_answer(problem, scope)

    def _check_origin(self, scope: Scope, headers: Headers) -> None:
        origin = headers.get("origin")
        if origin is None or scope["method"] in _SAFE_METHODS:
            return
        try:
            called_by = urlsplit(origin).netloc.lower()
        except ValueError:
            called_by = ""
        if called_by != headers.get("host", "").lower():
            raise Problem(403, "the request comes out of a page of another site", headers=_CLOSE)

    def _check_proxy(self, scope: Scope, headers: Headers) -> None:
        if self._access.required or not any(name in headers for name in _FORWARDED):
            return
        if not self._is_proxy((scope.get("client") or ("",))[0]):
            raise Problem(
                403,
                "the request comes through a proxy, and the service asks for no token: everybody whom the proxy lets "
                'in could use it; set tokens = "on", or name the proxy\'s address in trusted_proxies',
                headers=_CLOSE,
            )

    async def _is_other_user(self, scope: Scope, headers: Headers) -> bool:
        """Whether a program of another user calls, and not through a proxy that is named."""
        client, server = scope.get("client"), scope.get("server")
        if client is None or server is None or scope["path"] in _OPEN:
            return False
        if self._is_proxy(client[0]) and any(name in headers for name in _FORWARDED):
            return False
        return not await anyio.to_thread.run_sync(is_own_user, tuple(client), tuple(server))

    def _is_proxy(self, address: str) -> bool:
        try:
            return any(ipaddress.ip_address(address) in network for network in self._proxies)
        except ValueError:
            return False

    def _check_room(self, scope: Scope, headers: Headers) -> None:
        if scope["method"] != "POST" or not self._uploads(scope["path"]):
            return
        length = headers.get("content-length", "0")
        if length.isdigit() and int(length) > self._most_bytes:
            most = f"{self._most_bytes / 1e6:.0f} MB"
            raise Problem(413, f"the upload is over the limit of {most}; crop it", headers=_CLOSE)
        wait_s = self._busy()
        if wait_s is not None:
            self._refused()
            seconds = str(max(1, round(wait_s)))
            detail = f"as many parts wait as may; ask again in {seconds} s"
            raise Problem(503, detail, headers={"Retry-After": seconds, **_CLOSE})


def _needs_token(scope: Scope) -> bool:
    """Whether a request is nobody's business without a token; pages that are only looked at send to the sign-in
    themselves."""
    if scope["path"].startswith("/v1/"):
        return True
    return scope["method"] not in _SAFE_METHODS and scope["path"] != _SIGNING_IN
