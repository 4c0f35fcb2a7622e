"""The page of the programs' interface: every address, what it takes and answers, made from its OpenAPI description.

It loads nothing from elsewhere, so it stands where there is no internet.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.service.pages.frame import Frame

_MOST_EXAMPLE = 4_000
_GROUPS = {
    "parts": "Parts",
    "jobs": "Jobs",
    "service": "The service",
}


@dataclass(frozen=True)
class Field:
    """Something that an address takes.

    Attributes:
        name: of the field.
        where: path, query, header, form or body.
        kind: of its value, in words.
        required: whether it has to be there.
        words: what it is for.
    """

    name: str
    where: str
    kind: str
    required: bool
    words: str


@dataclass(frozen=True)
class Operation:
    """One method of an address.

    Attributes:
        method, path: how it is called.
        summary: what it does.
        fields: what it takes.
        answers: (status, what it means) each.
        example: of an answer, as JSON; empty where there is none.
    """

    method: str
    path: str
    summary: str
    fields: tuple[Field, ...]
    answers: tuple[tuple[str, str], ...]
    example: str


def add_interface_page(router: APIRouter, frame: Frame, described: Callable[[], dict[str, Any]]) -> None:
    """The route of the page; `described` gives the OpenAPI document."""

    @router.get("/docs")
    def interface(request: Request) -> Response:
        made = described()
        groups: dict[str, list[Operation]] = {}
        for path, methods in made["paths"].items():
            for method, said in methods.items():
                (tag, *_) = said.get("tags", ("service",))
                groups.setdefault(_GROUPS.get(tag, tag), []).append(_operation(method, path, said, made))
        return frame.page(
            request,
            "interface.html.j2",
            groups=groups,
            about=made["info"],
            words=made["info"].get("description", ""),
            secured=bool(made.get("security")),
        )


def _operation(method: str, path: str, said: Mapping[str, Any], whole: Mapping[str, Any]) -> Operation:
    fields = [
        Field(one["name"], one["in"], _kind(one.get("schema", {})), one.get("required", False), _words(one))
        for one in said.get("parameters", ())
    ]
    for media, content in said.get("requestBody", {}).get("content", {}).items():
        schema = _resolved(content.get("schema", {}), whole)
        where = "body (JSON)" if "json" in media else "form"
        needed = schema.get("required", ())
        fields += [
            Field(name, where, _kind(_resolved(one, whole)), name in needed, _words(one))
            for name, one in schema.get("properties", {}).items()
        ]
    answers = tuple((status, one.get("description", "")) for status, one in said["responses"].items())
    return Operation(
        method.upper(), path, said.get("summary", ""), tuple(fields), answers, _example(said["responses"])
    )


def _resolved(schema: Mapping[str, Any], whole: Mapping[str, Any]) -> Mapping[str, Any]:
    """A schema, looked up where it is named."""
    for one in (schema, *schema.get("allOf", ())):
        if "$ref" in one:
            found: Any = whole
            for name in one["$ref"].removeprefix("#/").split("/"):
                found = found[name]
            return {**found, **{key: value for key, value in schema.items() if key not in ("$ref", "allOf")}}
    return schema


def _kind(schema: Mapping[str, Any]) -> str:
    """What a value is, in words."""
    several = [one for one in schema.get("anyOf", ()) if one.get("type") != "null"]
    if several:
        return " or ".join(dict.fromkeys(_kind(one) for one in several))
    if "enum" in schema:
        return " | ".join(map(str, schema["enum"]))
    if schema.get("type") == "array":
        return f"{_kind(schema.get('items', {}))}, may be repeated"
    if schema.get("format") == "binary" or schema.get("contentMediaType"):
        return "file"
    words = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}
    return words.get(schema.get("type", ""), schema.get("title", "") or "any")


def _words(one: Mapping[str, Any]) -> str:
    return str(one.get("description") or one.get("schema", {}).get("description") or "")


def _example(responses: Mapping[str, Any]) -> str:
    for status in ("201", "200"):
        content = responses.get(status, {}).get("content", {}).get("application/json", {})
        examples = [content.get("example"), *(e.get("value") for e in content.get("examples", {}).values())]
        for example in filter(None, examples):
            text = json.dumps(example, indent=2, ensure_ascii=False)
            return text if len(text) <= _MOST_EXAMPLE else text[:_MOST_EXAMPLE] + "\n..."
    return ""
