"""All settings as a commented file, to begin with and for the documentation."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic_core import to_jsonable_python

from pipeline.cli.settings import MODELS
from pipeline.common.settings import Settings

_BEGINNING = """\
# Settings of tactile-marks. All of them stand here at their defaults, commented out: remove the # before a name.
# Environment variables and flags go over this file; `tactile-marks serve --help-all` names them.
"""
_TYPES = {
    bool: "true or false",
    str: "text",
    int: "whole number",
    float: "number",
    Path: "file or folder",
    dict: "table",
}


def settings_file() -> str:
    """A `tactile-marks.toml` with every setting at its default, commented out.

    A line of prose begins with "# ", a setting with "#" alone: without that sign the line is in force. Settings that
    are not set unless somebody gives them a value have none here either, and their type in its place:

    # Port of the web interface; 0 takes any free one.
    #port = 8417

    # Folder into which the camera puts its pictures: NAME.png is the part called NAME.
    #camera =    # file or folder
    """
    return "\n".join((_BEGINNING, *map(_table_of_file, MODELS)))


def _table_of_file(model: type[Settings]) -> str:
    written = [f"[{model.table}]\n"] if model.table else []
    last = ""
    for path, field in model.leaves().items():
        section, _, name = path.rpartition(".")
        if section != last:
            written.append(f"[{model.table}.{section}]\n")
            last = section
        lines = textwrap.wrap(str(field.description), 98, break_on_hyphens=False)
        default = to_jsonable_python(field.get_default(call_default_factory=True))
        unset = default is None or (field.default_factory is not None and default)
        value = f"   # {_type(field.annotation)}" if unset else json.dumps(default)
        written.append("".join(f"# {line}\n" for line in lines) + f"#{name} = {value}\n")
    return "\n".join(written)


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
