"""The settings as a table for the documentation."""

from __future__ import annotations

from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from pipeline.cli.settings import MODELS, flag_of
from pipeline.common.settings import Settings

_HEADINGS = ("setting", "flag", "variable", "type", "default", "what it does")
_TYPES = {
    bool: "true or false",
    str: "text",
    int: "whole number",
    float: "number",
    Path: "file or folder",
    dict: "table",
}


def settings_reference() -> str:
    """Every setting as Markdown: name, flag, environment variable, type, default and description.

    One table for each part of `tactile-marks.toml`, under a heading of the second level.
    """
    return "\n".join(_section(model) for model in MODELS)


def _section(model: type[Settings]) -> str:
    heading = str(model.__doc__).splitlines()[0].rstrip(".")
    where = f"In the table `[{model.table}]` of" if model.table else "At the top of"
    rows = [_HEADINGS, ("---",) * len(_HEADINGS)]
    for name, field in model.model_fields.items():
        described = str(field.description).replace("|", r"\|")
        rows.append(
            (f"`{name}`", f"`{flag_of(name)}`", f"`{model.variable(name)}`", _type(field.annotation), _default(field),
             described)
        )  # fmt: skip
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"## {heading}\n\n{where} `tactile-marks.toml`.\n\n{table}\n"


def _type(annotation: Any) -> str:
    """A type in words."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type(arguments[0])
    if origin is Literal:
        return ", ".join(map(str, arguments))
    if origin in (Union, UnionType):
        return _type(next(a for a in arguments if a is not type(None)))
    if origin is tuple:
        return (
            f"{_type(arguments[0])}, {'any number' if arguments[-1] is ... else f'{len(arguments)} of them'}"
        )
    return _TYPES[origin or annotation]


def _default(field: FieldInfo) -> str:
    value = field.default
    if field.default_factory is not None or value in (None, "", ()):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"
