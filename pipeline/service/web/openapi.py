"""The description of the interface (OpenAPI): summaries, problems, and tokens where they are asked for."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic import TypeAdapter

from pipeline.service.web.access import COOKIE
from pipeline.service.web.problem import ProblemBody


def describe_api(app: FastAPI, *, asked: bool) -> dict[str, Any]:
    """The OpenAPI document of an application.

    Args:
        app: the application.
        asked: whether it asks for tokens.
    """
    if app.openapi_schema:
        return app.openapi_schema
    made = FastAPI.openapi(app)
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
    return made
