"""The operator's pages: queue, review, parts and dashboard, made on the server; they work without script and internet.

/review  /review/{id}  /audit  /parts  /parts/{id}  /dashboard  /shadow  /jobs  /docs  /login  /static/{name}
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.golden_record import GoldenRecord
from pipeline.service.connections import Connection
from pipeline.service.pages.dashboard import add_dashboard
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.interface import add_interface_page
from pipeline.service.pages.jobs import add_job_pages
from pipeline.service.pages.login import add_login
from pipeline.service.pages.parts import add_part_pages
from pipeline.service.pages.review import add_review_pages
from pipeline.service.pages.shadow import add_shadow_page

if TYPE_CHECKING:
    from pipeline.service.job_folder import JobFolder


def pages_router(
    frame: Frame,
    *,
    drift: Callable[[], str] = str,
    golden: Callable[[], tuple[GoldenRecord, ...]] = tuple,
    connections: Callable[[], tuple[Connection, ...]] = tuple,
    jobs: JobFolder | None = None,
    interface: Callable[[], dict[str, Any]] | None = None,
) -> APIRouter:
    """The routes of all pages.

    Args:
        frame: what they are made with.
        drift: says how the latest parts differ from the certified ones; empty where they do not.
        golden: scans of the golden part, the newest first.
        connections: to others: targets of results, ports.
        jobs: that parts may be read by; without it there are no pages of them.
        interface: description of the programs' interface (OpenAPI); without it there is no page of it.
    """
    frame.environment.globals["teaches"] = jobs is not None
    router = APIRouter(include_in_schema=False)
    for add in (add_review_pages, add_part_pages, add_shadow_page, add_login):
        add(router, frame)
    add_dashboard(router, frame, drift, golden, connections)
    if jobs is not None:
        add_job_pages(router, frame, jobs)
    if interface is not None:
        add_interface_page(router, frame, interface)

    @router.get("/static/{name}")
    async def static(request: Request, name: str) -> Response:
        answer = await frame.assets.get_response(name, request.scope)
        answer.headers["Cache-Control"] = (
            "no-cache"  # asked for again each time, and sent where it has changed
        )
        return answer

    return router
