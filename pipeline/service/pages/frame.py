"""What all pages have in common: templates, who is looking, forms that only our own pages can send, refusals.

request --PageRoute--> route --> page --> answer with its headers
             \\-> DeniedError, NotFoundError, StoreError, PageError --> a page that says so
"""

from __future__ import annotations

import hmac
import re
import secrets
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import jinja2
from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from glyphs.errors import MarksError
from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState, Scope
from pipeline.service.pages.assets import Assets
from pipeline.service.pages.places import LOW_MARGIN, part_cells
from pipeline.service.web.access import Access, Caller, DeniedError
from pipeline.service.web.addresses import relative, to_root
from pipeline.store.errors import NotFoundError, StoreError, UnfitError

if TYPE_CHECKING:
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store

FORM_COOKIE = "tactile_marks_form"
WHO_COOKIE = "tactile_marks_who"
A_YEAR_S = 365 * 24 * 3600
MOST_COUNTED = 99
_FORM_VALUE = re.compile(r"[A-Za-z0-9_-]{43}")
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; frame-ancestors 'none'; form-action 'self'; base-uri 'none'; object-src 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cache-Control": "no-store",
}
STATE_NAMES = {
    PartState.TOUCH_NEEDED: "touch needed",
    PartState.ACCEPTED: "accepted",
    PartState.REVIEW: "to review",
    PartState.REVIEWED: "reviewed",
    PartState.SHADOW: "in shadow",
}


class PageError(MarksError):
    """What a person asked for cannot be done; the message says why and what to do.

    Attributes:
        status: of the answer.
    """

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class Frame:
    """What every page is made with.

    Attributes:
        store: of the parts.
        evidence: where their pictures are kept.
        access: who may look and who may say.
        assets: script and style.
        environment: templates.
        low_margin: lead of the first over the second candidate below which a place is unsure.
        review: keeps what a person says; arguments as `Store.review`.
        undo: takes a person's own review back, by the part's id and the person.
        second_reader: whether two people must say the same of a part, the second without seeing what was read.
        outside_format: what speaks against a text as a serial of a job's format; empty where nothing does.
    """

    store: Store
    evidence: EvidenceFolder
    access: Access
    assets: Assets
    environment: jinja2.Environment
    low_margin: float
    review: Callable[..., PartRecord]
    undo: Callable[[str, Person], PartRecord]
    second_reader: bool = False
    outside_format: Callable[[str, str], str] = lambda text, job: ""

    @classmethod
    def make(
        cls,
        store: Store,
        evidence: EvidenceFolder,
        access: Access,
        *,
        low_margin: float = LOW_MARGIN,
        review: Callable[..., PartRecord] | None = None,
        undo: Callable[[str, Person], PartRecord] | None = None,
        shadow: bool = False,
        second_reader: bool = False,
        outside_format: Callable[[str, str], str] = lambda text, job: "",
    ) -> Frame:
        """With the templates and files of the package."""
        assets = Assets()
        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("pipeline.service.pages", "templates"),
            autoescape=True,
            trim_blocks=True,
            lstrip_blocks=True,
            undefined=jinja2.StrictUndefined,
        )
        environment.globals["static"] = jinja2.pass_context(
            lambda context, name: _here(context, assets.address(name))
        )
        environment.globals["state_names"] = STATE_NAMES
        environment.globals["shadow"] = shadow
        environment.globals["part_cells"] = lambda part: part_cells(part, low_margin=low_margin)
        environment.filters.update(iso=_iso, utc=_utc, view=_view, here=_here)
        return cls(
            store,
            evidence,
            access,
            assets,
            environment,
            low_margin,
            review or store.review,
            undo or (lambda part_id, person: store.undo_review(part_id, person=person)),
            second_reader,
            outside_format,
        )

    def page(
        self,
        request: Request,
        template: str,
        *,
        status: int = 200,
        caller: Caller | None = None,
        **values: Any,
    ) -> Response:
        """A page; its forms carry a value that only this browser's cookie has too."""
        given = request.cookies.get(FORM_COOKIE, "")
        known = bool(_FORM_VALUE.fullmatch(given))
        form_value = given if known else secrets.token_urlsafe(32)
        text = self.environment.get_template(template).render(
            caller=caller,
            signed_in=self.access.asked(request) and caller is not None,
            waiting=None if caller is None else self.waiting(),
            path=request.url.path,
            up=to_root(request.scope),
            form_value=form_value,
            **values,
        )
        answer = HTMLResponse(text, status_code=status, headers=_HEADERS)
        if not known:
            self.set_cookie(request, answer, FORM_COOKIE, form_value, max_age_s=None)
        return answer

    def waiting(self) -> str:
        """How many parts wait for a person."""
        n = len(self.store.queue(limit=MOST_COUNTED + 1))
        return f"{MOST_COUNTED}+" if n > MOST_COUNTED else str(n)

    def set_cookie(
        self, request: Request, answer: Response, name: str, value: str, *, max_age_s: int | None
    ) -> None:
        """A cookie that only this service's own pages send back, and no script reads."""
        answer.set_cookie(
            name,
            value,
            max_age=max_age_s,
            path="/",
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
        )

    def check_form(self, request: Request, given: str) -> None:
        """Refuse a form that none of our own pages has sent.

        Raises:
            PageError: its value is not the cookie's.
        """
        kept = request.cookies.get(FORM_COOKIE, "")
        same = hmac.compare_digest(kept.encode(), given.encode())
        if not (_FORM_VALUE.fullmatch(kept) and same):
            raise PageError(
                403,
                "This form did not come from a page of this service that is open in this browser, or cookies "
                "are off. Nothing was changed: load the page again.",
            )

    def reader(self, request: Request) -> Caller:
        """Who looks.

        Raises:
            DeniedError: a token that is not there or does not allow it.
        """
        return self.access.caller(request, Scope.READ)

    def refusal(self, request: Request, status: int, message: str) -> Response:
        """A page that says why there is no other."""
        return self.page(request, "message.html.j2", status=status, message=message, shown_status=status)


def page_route(frame: Frame) -> type[APIRoute]:
    """Routes whose expected failures are answered by pages."""

    class PageRoute(APIRoute):
        """A route of the pages."""

        def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
            """As FastAPI's, with refusals in words."""
            handle = super().get_route_handler()

            async def handled(request: Request) -> Response:
                try:
                    return await handle(request)
                except DeniedError as error:
                    if error.status == 401:
                        return _to_login(request)
                    return frame.refusal(request, error.status, str(error))
                except PageError as error:
                    return frame.refusal(request, error.status, str(error))
                except NotFoundError as error:
                    return frame.refusal(request, 404, str(error))
                except UnfitError as error:
                    return frame.refusal(request, 422, str(error))
                except StoreError as error:
                    return frame.refusal(request, 503, str(error))

            return handled

    return PageRoute


def _to_login(request: Request) -> Response:
    path = request.url.path
    if request.method == "GET" and request.url.query:
        path += f"?{request.url.query}"
    return see(request, f"/login?to={quote(path, safe='')}")


def see(request: Request, address: str) -> Response:
    """Answer a form by the page to look at next."""
    headers = {"Cache-Control": "no-store"}
    return RedirectResponse(relative(request.scope, address), status_code=303, headers=headers)


@jinja2.pass_context
def _here(context: jinja2.runtime.Context, address: str) -> str:
    """An address of the service, such as /parts, as the page made now has to write it."""
    return f"{context['up']}{address.removeprefix('/')}"


def _iso(at: datetime) -> str:
    return at.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def _utc(at: datetime) -> str:
    return at.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _view(box: tuple[float, float, float, float]) -> str:
    return " ".join(f"{v:g}" for v in box)
