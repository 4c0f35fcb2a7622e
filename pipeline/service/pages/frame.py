"""Common parts of all pages: templates, the caller's rights, cookies."""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote, urlencode

import jinja2
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.staticfiles import StaticFiles

from pipeline.common.names import printable_name
from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, Scope
from pipeline.common.shares import share
from pipeline.service.pages.places import part_cells, why_not_accepted
from pipeline.service.web.access import Caller
from pipeline.service.web.problem import Problem, relative, to_root
from recognition.active.active_reading import StopReason
from recognition.decide.risk_text import risk_in_words

if TYPE_CHECKING:
    from pipeline.service.app import Service

SEAT_COOKIE, WHO_COOKIE = "tactile_marks_seat", "tactile_marks_who"
MOST_WHO = 80
PARTS_SHOWN = 50
_A_YEAR_S = 365 * 24 * 3600
_SEAT = re.compile(r"[A-Za-z0-9_-]{43}")
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; form-action 'self'; base-uri 'none'; "
        "object-src 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Frame:
    """Templates and services shared by all pages."""

    def __init__(self, service: Service) -> None:
        self.service, self.store, self.access = service, service.store, service.access
        self.assets = StaticFiles(packages=[(__package__, "static")])
        self.environment = jinja2.Environment(
            loader=jinja2.PackageLoader("pipeline.service.pages", "templates"),
            autoescape=True,
            trim_blocks=True,
            lstrip_blocks=True,
            undefined=jinja2.StrictUndefined,
        )
        self.environment.globals.update(
            shadow=self.service.settings.shadow,
            part_cells=part_cells,
            why_not_accepted=why_not_accepted,
            share=share,
        )
        self.environment.filters.update(
            iso=_iso, utc=_utc, here=_here, sentence=_sentence, stop_words=_stop_words, risk=risk_in_words
        )

    def reader_view(self, request: Request) -> View:
        return View(self, request, self.access.caller(request, Scope.READ))

    def reviewer_view(self, request: Request) -> View:
        return View(self, request, self.access.caller(request, Scope.REVIEW))

    def render(
        self,
        request: Request,
        template: str,
        *,
        status: int = 200,
        caller: Caller | None = None,
        **values: Any,
    ) -> Response:
        """Render a page; a new browser gets an id."""
        text = self.environment.get_template(template).render(
            caller=caller,
            signed_in=self.access.needs_token(request) and caller is not None,
            waiting=0 if caller is None else self.store.queue_length(),
            path=request.url.path,
            up=to_root(request.scope),
            **values,
        )
        answer = HTMLResponse(text, status_code=status, headers=_HEADERS)
        if not _SEAT.fullmatch(request.cookies.get(SEAT_COOKIE, "")):
            set_cookie(request, answer, SEAT_COOKIE, secrets.token_urlsafe(32))
        return answer

    def refusal(self, request: Request, status: int, message: str) -> Response:
        return self.render(request, "message.html.j2", status=status, message=message, shown_status=status)


@dataclass(frozen=True)
class View:
    """One request for a page: its caller, and the answers to it."""

    frame: Frame
    request: Request
    caller: Caller

    @property
    def may_review(self) -> bool:
        return Scope.REVIEW in self.caller.scopes

    @property
    def person(self) -> Person:
        if self.caller.token:
            return self.caller.person()
        cookie = self.request.cookies.get(SEAT_COOKIE, "")
        # the cookie is a secret; the store sees its hash
        seat = hashlib.sha256(cookie.encode()).hexdigest()[:32] if cookie else ""
        who = printable_name(unquote(self.request.cookies.get(WHO_COOKIE, "")))
        return Person(who[:MOST_WHO], seat=seat)

    def named(self, name: str) -> Person:
        """The person at the page with the typed name; a token's name has priority."""
        return self.person if self.caller.token else replace(self.person, name=name)

    def page(self, template: str, *, problem: Problem | None = None, **values: Any) -> Response:
        status, fault = (problem.status, problem.detail) if problem else (200, "")
        values |= {"fault": fault, "may_review": self.may_review}
        return self.frame.render(self.request, template, status=status, caller=self.caller, **values)

    def redirect(self, address: str, *, who: str = "") -> Response:
        answer = redirect(self.request, address)
        if who:
            set_cookie(self.request, answer, WHO_COOKIE, quote(who), max_age_s=_A_YEAR_S)
        return answer


def page_of(parts: Sequence[PartRecord], path: str, query: dict[str, str], before: str) -> dict[str, Any]:
    """A page of a list of parts (one too many if there are more), with the addresses of the first and next page."""
    shown = parts[:PARTS_SHOWN]
    older = {**query, "before": shown[-1].id} if len(parts) > PARTS_SHOWN else {}
    return {
        "parts": shown,
        "older": f"{path}?{urlencode(older)}" if older else "",
        "newest": f"{path}?{urlencode(query)}" if before else "",
    }


def redirect(request: Request, address: str) -> Response:
    """Send the browser to another page of the service."""
    where = relative(request.scope, address)
    return RedirectResponse(where, status_code=303, headers={"Cache-Control": "no-store"})


def set_cookie(
    request: Request, answer: Response, name: str, value: str, *, max_age_s: int | None = None
) -> None:
    """Set a cookie that only this service's own pages send back, and that no script can read."""
    secure = request.url.scheme == "https"
    answer.set_cookie(
        name, value, max_age=max_age_s, path="/", httponly=True, samesite="strict", secure=secure
    )


@jinja2.pass_context
def _here(context: jinja2.runtime.Context, address: str) -> str:
    return f"{context['up']}{address.removeprefix('/')}"


def _stop_words(reason: str) -> str:
    return StopReason(reason).message if reason in set(StopReason) else reason


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith((".", "?", "!")) else ".")


def _iso(time: datetime) -> str:
    return time.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def _utc(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
