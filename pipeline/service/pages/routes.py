"""The operator's pages: queue, review, parts and dashboard, made on the server; they work without script and internet.

/review  /review/{id}  /audit  /parts  /parts/{id}  /dashboard  /shadow  /jobs  /docs  /login  /static/{name}
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.dashboard import add_dashboard
from pipeline.service.pages.frame import Frame, redirect, set_cookie
from pipeline.service.pages.jobs import add_job_pages
from pipeline.service.pages.parts import add_part_pages
from pipeline.service.pages.review import add_review_pages
from pipeline.service.web.access import COOKIE
from pipeline.service.web.uploads import SMALL_BODY
from pipeline.store.access import SIGNED_IN_S

Described = Mapping[str, Any]
_KINDS = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}


def pages_router(frame: Frame) -> APIRouter:
    """The routes of all pages of a service."""
    router = APIRouter(include_in_schema=False, max_body_size=SMALL_BODY)
    for add in (
        add_review_pages,
        add_part_pages,
        add_job_pages,
        add_dashboard,
        add_interface_page,
        add_login,
    ):
        add(router, frame)

    @router.get("/static/{name}")
    async def static(request: Request, name: str) -> Response:
        answer = await frame.assets.get_response(name, request.scope)
        # asked for again each time, and sent where it has changed
        answer.headers["Cache-Control"] = "no-cache"
        return answer

    return router


def add_login(router: APIRouter, frame: Frame) -> None:
    """The routes to sign in and out."""
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
    """An address of this service to open, otherwise that of the queue: never another host."""
    own = to.startswith("/") and not to.startswith("//") and "\\" not in to and to.isprintable()
    return to if own else "/review"


def add_interface_page(router: APIRouter, frame: Frame) -> None:
    """The route of the page about the HTTP interface: every address with its inputs and answers.

    It loads nothing from elsewhere, so it works without internet.
    """

    @router.get("/docs")
    def interface(request: Request) -> Response:
        made = request.app.openapi()
        groups: dict[str, list[Described]] = {}
        for path, methods in made["paths"].items():
            for method, one in methods.items():
                operation = {**one, "path": path, "method": method.upper(), "takes": list(_fields(one, made))}
                groups.setdefault(one["tags"][0].capitalize(), []).append(operation)
        return frame.render(request, "interface.html.j2", groups=groups, made=made)


def _fields(operation: Described, made: Described) -> Iterator[tuple[str, str, str, bool, str]]:
    """Name, place, kind, necessity and description of every input of an operation."""
    for one in operation.get("parameters", ()):
        words = one.get("description") or one["schema"].get("description", "")
        yield one["name"], one["in"], _kind(one["schema"], made), one.get("required", False), words
    for media, content in operation.get("requestBody", {}).get("content", {}).items():
        schema = _resolved(content["schema"], made)
        for name, one in schema.get("properties", {}).items():
            kind, needed = _kind(one, made), name in schema.get("required", ())
            yield name, "body (JSON)" if "json" in media else "form", kind, needed, one.get("description", "")


def _resolved(schema: Described, made: Described) -> Described:
    """A schema, resolved if it is a reference."""
    for one in (schema, *schema.get("allOf", ())):
        if "$ref" in one:
            found: Described = made["components"]["schemas"][one["$ref"].rpartition("/")[2]]
            return {**found, **{key: value for key, value in schema.items() if key not in ("$ref", "allOf")}}
    return schema


def _kind(schema: Described, made: Described) -> str:
    """The kind of a value, in words."""
    schema = _resolved(schema, made)
    if several := [one for one in schema.get("anyOf", ()) if one.get("type") != "null"]:
        return " or ".join(dict.fromkeys(_kind(one, made) for one in several))
    if "enum" in schema:
        return " | ".join(map(str, schema["enum"]))
    if schema.get("type") == "array":
        return f"{_kind(schema.get('items', {}), made)}, may be repeated"
    if schema.get("format") == "binary" or schema.get("contentMediaType"):
        return "file"
    return _KINDS.get(schema.get("type", ""), schema.get("title", "") or "any")
