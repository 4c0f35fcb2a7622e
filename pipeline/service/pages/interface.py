"""The page of the programs' interface: every address, what it takes and answers, made from its OpenAPI description.

It loads nothing from elsewhere, so it works without internet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.frame import Frame

Described = Mapping[str, Any]
_KINDS = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}


def add_interface_page(router: APIRouter, frame: Frame) -> None:
    """The route of the page."""

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
    """Name, place, kind, whether it is needed, and description of everything that an operation takes."""
    for one in operation.get("parameters", ()):
        words = one.get("description") or one["schema"].get("description", "")
        yield one["name"], one["in"], _kind(one["schema"], made), one.get("required", False), words
    for media, content in operation.get("requestBody", {}).get("content", {}).items():
        schema = _resolved(content["schema"], made)
        for name, one in schema.get("properties", {}).items():
            kind, needed = _kind(one, made), name in schema.get("required", ())
            yield name, "body (JSON)" if "json" in media else "form", kind, needed, one.get("description", "")


def _resolved(schema: Described, made: Described) -> Described:
    """A schema, looked up where it is named."""
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
