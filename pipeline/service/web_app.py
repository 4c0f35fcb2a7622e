"""The web application of a service: routes, pages, answers to failures, and middleware."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import FastAPI
from pydantic import TypeAdapter
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from pipeline.common.version import program_version
from pipeline.service.api import parts_router
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.routes import pages_router
from pipeline.service.service_api import service_router
from pipeline.service.web.access import COOKIE
from pipeline.service.web.door import Door
from pipeline.service.web.problem import ProblemBody, add_problem_handlers

if TYPE_CHECKING:
    from pipeline.service.app import Service


def create_app(service: Service) -> FastAPI:
    """The web application of a service."""
    settings = service.settings
    frame = Frame(service)
    routers = (parts_router(service), service_router(service), pages_router(frame))
    app = FastAPI(
        title="tactile-marks",
        summary="Reads die-stamped serials: by camera first, by touch when the camera is unsure.",
        description="Times are in UTC, lengths in mm. Every failure is application/problem+json (RFC 9457).",
        version=program_version(),
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        docs_url=None,  # its page would load scripts from the internet; ours is at /docs
        redoc_url=None,
        openapi_url="/openapi.json",
        servers=[{"url": settings.root_path}] if settings.root_path else None,
        lifespan=service.running,
        telemetry={"tracing": False, "metrics": False, "logs": False},
        redirect_slashes=False,
        # include_router would build every route, and the schemas of its answers, a second time
        routes=[route for router in routers for route in router.routes],
    )
    app.state.problem_page = frame.refusal
    add_problem_handlers(app)
    app.openapi = lambda: _describe_api(app, tokens_required=service.access.required)  # type: ignore[method-assign]
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=list(settings.trusted_proxies))
    # the one added last is outermost
    app.add_middleware(
        Door,
        settings=settings,
        upload_bytes=service.upload_bytes,
        access=service.access,
        metrics=service.metrics,
        busy=service.pool.retry_after_s,
    )
    return app


def _describe_api(app: FastAPI, *, tokens_required: bool) -> dict[str, Any]:
    if app.openapi_schema:
        return app.openapi_schema
    document = FastAPI.openapi(app)
    for operation in (each for methods in document["paths"].values() for each in methods.values()):
        # the first sentence of a route's docstring is its summary
        summary, _, description = operation.pop("description", "").partition("\n\n")
        words = {"summary": summary.rstrip("."), "description": description}
        operation |= {name: text for name, text in words.items() if text}
    document["components"]["schemas"][ProblemBody.__name__] = TypeAdapter(ProblemBody).json_schema()
    about = "tactile-marks tokens add NAME --scope write"
    document["components"]["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer", "description": about},
        "page": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "operator page login"},
    }
    if tokens_required:
        document["security"] = [{"token": []}, {"page": []}]
    return document
