"""Signing in with a token, where tokens are required, and out again."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.frame import Frame, redirect, set_cookie
from pipeline.service.web.access import COOKIE
from pipeline.store.access import SIGNED_IN_S


def add_login(router: APIRouter, frame: Frame) -> None:
    """The routes of signing in and out."""
    access = frame.access

    @router.get("/login")
    def login(request: Request, to: str = "/review") -> Response:
        if not access.asked(request):
            return redirect(request, own_address(to))
        return frame.render(request, "login.html.j2", to=own_address(to), fault="")

    @router.post("/login")
    def log_in(
        request: Request, secret: Annotated[str, Form()] = "", to: Annotated[str, Form()] = "/review"
    ) -> Response:
        value = frame.store.open_session(secret.strip())
        if value is None:
            fault = "This token is not known, has expired or was revoked. Type it again or ask for another."
            return frame.render(request, "login.html.j2", status=403, to=own_address(to), fault=fault)
        answer = redirect(request, own_address(to))
        set_cookie(request, answer, COOKIE, value, max_age_s=SIGNED_IN_S)
        return answer

    @router.post("/logout")
    def log_out(request: Request) -> Response:
        frame.store.close_session(request.cookies.get(COOKIE, ""))  # wherever else the cookie is
        answer = redirect(request, "/login")
        answer.delete_cookie(COOKIE, path="/")
        return answer


def own_address(to: str) -> str:
    """An address of this service to go to, or the queue's: never another host's."""
    own = to.startswith("/") and not to.startswith("//") and "\\" not in to and to.isprintable()
    return to if own else "/review"
