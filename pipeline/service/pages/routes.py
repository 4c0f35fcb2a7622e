"""The operator's pages: queue, review, parts and dashboard, made on the server; they work without script and internet.

/review  /review/{id}  /audit  /parts  /parts/{id}  /dashboard  /shadow  /jobs  /docs  /login  /static/{name}
"""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.dashboard import add_dashboard
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.interface import add_interface_page
from pipeline.service.pages.jobs import add_job_pages
from pipeline.service.pages.login import add_login
from pipeline.service.pages.parts import add_part_pages
from pipeline.service.pages.review import add_review_pages
from pipeline.service.pages.shadow import add_shadow_page
from pipeline.service.web.uploads import SMALL_BODY


def pages_router(frame: Frame) -> APIRouter:
    """The routes of all pages of a service."""
    router = APIRouter(include_in_schema=False, max_body_size=SMALL_BODY)
    for add in (
        add_review_pages,
        add_part_pages,
        add_job_pages,
        add_dashboard,
        add_shadow_page,
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
