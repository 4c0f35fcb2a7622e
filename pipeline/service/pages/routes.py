"""The operator's page: queue, review, parts and dashboard, made on the server; works without script and internet.

/review  /review/{id}  /audit  /audit/{id}  /parts  /parts/{id}  /dashboard  /shadow  /jobs  /login  /static/{name}
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.audit import add_audit_pages
from pipeline.service.pages.dashboard import add_dashboard
from pipeline.service.pages.frame import Frame, page_route
from pipeline.service.pages.jobs import add_job_pages
from pipeline.service.pages.login import add_login
from pipeline.service.pages.parts import add_part_pages
from pipeline.service.pages.people import add_claims
from pipeline.service.pages.places import LOW_MARGIN
from pipeline.service.pages.review import add_review_pages
from pipeline.service.pages.shadow import add_shadow_page

if TYPE_CHECKING:
    from pipeline.common.records import PartRecord
    from pipeline.service.access import Access
    from pipeline.service.job_folder import JobFolder
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store


def pages_router(
    store: Store,
    evidence: EvidenceFolder,
    access: Access,
    *,
    low_margin: float = LOW_MARGIN,
    review: Callable[..., PartRecord] | None = None,
    drift: Callable[[], str] = str,
    jobs: JobFolder | None = None,
    shadow: bool = False,
    second_reader: bool = False,
    outside_format: Callable[[str, str], str] = lambda text, job: "",
) -> APIRouter:
    """The routes of all pages.

    Args:
        store: of the parts.
        evidence: where their pictures are kept; they are shown from `/v1/parts/{id}/pictures/...`.
        access: who may look, and who may review.
        low_margin: lead of the first over the second candidate below which a place is marked unsure.
        review: keeps what a person says, `Store.review` unless given.
        drift: says how the latest parts differ from the certified ones; empty where they do not.
        jobs: that parts may be read by; without it there are no pages of them.
        shadow: whether the service decides nothing.
        second_reader: whether two people must say the same of a part, the second without seeing what was read.
        outside_format: what speaks against a text as a serial of a job's format; empty where nothing does.
    """
    frame = Frame.make(
        store,
        evidence,
        access,
        low_margin=low_margin,
        review=review,
        shadow=shadow,
        second_reader=second_reader,
        outside_format=outside_format,
    )
    frame.environment.globals["teaches"] = jobs is not None
    router = APIRouter(route_class=page_route(frame), include_in_schema=False)
    add_review_pages(router, frame)
    add_audit_pages(router, frame)
    add_claims(router, frame)
    add_part_pages(router, frame)
    add_dashboard(router, frame, drift)
    add_shadow_page(router, frame)
    if jobs is not None:
        add_job_pages(router, frame, jobs)
    add_login(router, frame)

    @router.get("/static/{name}")
    async def static(request: Request, name: str) -> Response:
        return await frame.assets.get_response(name, request.scope)

    return router
