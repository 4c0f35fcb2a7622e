"""The description of the interface (OpenAPI): summaries, problems, and tokens where they are asked for."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from pipeline.service.web.access import COOKIE
from pipeline.service.web.problem import ProblemBody


def describe_api(app: FastAPI, *, asked: bool, root_path: str = "") -> dict[str, Any]:
    """The OpenAPI document of an application.

    Args:
        app: the application.
        asked: whether it asks for tokens.
        root_path: prefix of a proxy in front of it; empty: there is none.
    """
    if app.openapi_schema:
        return app.openapi_schema
    made = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        license_info=app.license_info,
        routes=app.routes,
        servers=[{"url": root_path}] if root_path else None,
        description="Times are in UTC, lengths in mm. Every failure is application/problem+json (RFC 9457).",
    )
    for one in (one for methods in made["paths"].values() for one in methods.values()):
        # the first sentence of a route's docstring is its summary
        summary, _, rest = one.pop("description", "").partition("\n\n")
        one |= ({"summary": summary.rstrip(".")} if summary else {}) | ({"description": rest} if rest else {})
    schemas = made["components"]["schemas"]
    schemas[ProblemBody.__name__] = TypeAdapter(ProblemBody).json_schema()
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    about = "tactile-marks tokens add NAME --scope write"
    made["components"]["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer", "description": about},
        "page": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "the operator page's"},
    }
    if asked:
        made["security"] = [{"token": []}, {"page": []}]
    app.openapi_schema = made
    return made
