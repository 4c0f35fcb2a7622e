"""The web application of a service: routes, pages, answers to failures, and what lies before them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, FastAPI
from fastapi.responses import Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from starlette.middleware.trustedhost import TrustedHostMiddleware
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from pipeline.common.records import Scope
from pipeline.common.version import program_version
from pipeline.service.api.answers import may, problems
from pipeline.service.api.export import export_router
from pipeline.service.api.golden import golden_router
from pipeline.service.api.jobs import jobs_router
from pipeline.service.api.lookup import lookup_router
from pipeline.service.api.parts import parts_router
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.routes import pages_router
from pipeline.service.web.access import Caller
from pipeline.service.web.door import Door
from pipeline.service.web.openapi import describe_api
from pipeline.service.web.problem import Problem
from pipeline.service.web.problem_responses import add_problem_handlers

if TYPE_CHECKING:
    from pipeline.service.app import Service
    from pipeline.service.settings import ServiceSettings


def create_app(service: Service) -> FastAPI:
    """The web application of a service."""
    settings = service.settings
    frame = Frame(service)
    routers = (
        parts_router(service),
        golden_router(service),
        export_router(service),
        lookup_router(service),
        jobs_router(service),
        pages_router(frame),
        _service_router(service),
    )
    app = FastAPI(
        title="tactile-marks",
        summary="Reads die-stamped serials: by camera first, by touch when the camera is unsure.",
        description="Times are in UTC, lengths in mm. Every failure is application/problem+json (RFC 9457).",
        version=program_version(),
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        docs_url=None,  # its pages would load scripts from the internet; ours is pages.interface
        redoc_url=None,
        openapi_url="/openapi.json",
        servers=[{"url": settings.root_path}] if settings.root_path else None,
        lifespan=service.running,
        max_body_size=settings.limits.upload_bytes,
        telemetry={"tracing": False, "metrics": False, "logs": False},
        redirect_slashes=False,
        # included routers would make every route, and the schemas of its answers, a second time
        routes=[route for router in routers for route in router.routes],
    )
    app.state.problem_page = frame.refusal
    add_problem_handlers(app)
    app.openapi = lambda: describe_api(app, asked=service.access.required)  # type: ignore[method-assign]
    # the last one lies outermost
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=_names(settings), www_redirect=False)
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=list(settings.trusted_proxies))
    app.add_middleware(
        Door,
        settings=settings,
        access=service.access,
        metrics=service.metrics,
        busy=service.pool.retry_after_s,
    )
    return app


def _names(settings: ServiceSettings) -> tuple[str, ...]:
    """Names that the service answers to; any if tokens are asked for and no list is given."""
    if settings.tokens_asked and not settings.hosts:
        return ("*",)
    names = (*settings.hosts, settings.host, "localhost", "127.0.0.1", "::1")
    return tuple(f"[{name}]" if ":" in name and not name.startswith("[") else name for name in names)


def _service_router(service: Service) -> APIRouter:
    """Routes about the service itself; the first three need no token."""
    router, Reads = APIRouter(tags=["service"]), may(service.access, Scope.READ)
    not_yet = {**problems(503)[503], "description": "not yet; the detail says why"}

    @router.get("/healthz")
    async def healthz() -> dict[str, str]:
        """Whether the service is alive."""
        return {"status": "alive"}

    @router.get("/readyz", responses={503: not_yet})
    def readyz() -> dict[str, str]:
        """Whether parts can be read."""
        if why := service.why_not_ready():
            raise Problem(503, why, headers={"Retry-After": "1"})
        return service.state()

    @router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
    def metrics() -> Response:
        """Numbers for Prometheus."""
        return Response(generate_latest(service.metrics.registry), media_type=CONTENT_TYPE_LATEST)

    @router.get("/v1/databases", responses=problems(401, 403))
    def databases(caller: Caller = Reads) -> list[dict[str, Any]]:
        """Glyph databases that a part may be read with."""
        return service.jobs.databases.listed()

    return router
