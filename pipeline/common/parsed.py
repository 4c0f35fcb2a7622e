"""Read TOML and JSON that people write; every fault of the text, nesting included, raises the same error."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from glyphs.errors import FileError
from pipeline.common.output_paths import write_text
from pipeline.errors import DataError, naming, require_file

MOST_BYTES = 1_000_000  # of a file that a person has written
_MOST_SHOWN = 200
_TOO_DEEP = re.compile(r"""(?<!["'\w-])(?:["'\w-]++[ \t]*+\.[ \t]*+){201}""")
"""A key with too many dots: the parser's time and memory grow with their square."""
_TWICE = re.compile(
    r"Cannot (?:declare|redefine namespace|mutate immutable namespace) \((.*?),?\).*at (line \d+)"
)
"""Message of the parser about a table that is there twice, or also as dotted keys."""
_OVERWRITTEN = re.compile(r"Cannot overwrite a value \(at ([^,)]+)")

Model = TypeVar("Model")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Strict(BaseModel):
    """Base of models of files that people write: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def toml_of(path: Path) -> dict[str, Any]:
    """The table in a TOML file. Raises FileError: it is not a regular file, too long, or not TOML."""
    require_file(path, most_bytes=MOST_BYTES)
    try:
        text = path.read_bytes().decode("utf-8-sig")
        if _TOO_DEEP.search(text):
            raise ValueError("a key of more than 200 dots")
        return tomllib.loads(text)
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", "check its permissions") from error
    except RecursionError as error:
        raise FileError(path, "nests brackets too deeply for TOML", "take them out") from error
    except UnicodeDecodeError as error:
        raise FileError(path, "is not UTF-8 text", "save it as UTF-8") from error
    except ValueError as error:  # a TOMLDecodeError, or a number that is too long
        if twice := _TWICE.search(str(error)):
            table = ".".join(re.findall(r"'([^']+)'", twice[1]))
            what = f"has a second [{table}] in {twice[2]}"
            raise FileError(path, what, "put all its settings in one place") from error
        if again := _OVERWRITTEN.search(str(error)):
            raise FileError(path, f"sets a name twice, again in {again[1]}", "remove one of them") from error
        raise FileError(path, f"is not TOML ({error})", "correct that line") from error


def toml_text(table: Mapping[str, Any], name: str = "") -> str:
    """Write a table as TOML: strings, numbers, lists of them, and nested tables."""
    # JSON strings, numbers and lists are valid TOML, except for DEL, which must be escaped
    lines = [
        f"{key} = {json.dumps(value, ensure_ascii=False)}\n".replace("\x7f", "\\u007f")
        for key, value in table.items()
        if not isinstance(value, Mapping)
    ]
    head = f"[{name}]\n" if name and lines else ""
    inner = [toml_text(v, f"{name}.{k}" if name else k) for k, v in table.items() if isinstance(v, Mapping)]
    return "\n".join(filter(None, [head + "".join(lines), *inner]))


def json_of(text: str | bytes) -> Any:
    """Parse a JSON text. Raises ValueError: it is not JSON, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("too many brackets") from error


def shown(value: object) -> str:
    """A value as Python writes it, shortened."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def read_toml(
    path: Path,
    model: type[Model] | TypeAdapter[Model],
    *,
    format_version: int | None = None,
    hidden: Collection[str] = (),
) -> Model:
    """Read a TOML file as a model. Raises FileError: it is not TOML or of another version; a key is unknown, missing or
    invalid. A file without a version counts as version 1; with a `format_version` of None files have no version.
    `hidden` are names of the model's alternatives, which are not keys of the file."""
    written = toml_of(path)
    if format_version is not None and (version := written.pop("format_version", 1)) != format_version:
        says = f"has format version {version!r}; this program reads {format_version}"
        raise FileError(path, says, "update this program, or write the file again")
    adapter = model if isinstance(model, TypeAdapter) else TypeAdapter(model)
    with naming(path):
        try:
            return adapter.validate_python(written)
        except ValidationError as error:
            raise DataError(*wrong_key(error, hidden)) from error


def wrong_key(error: ValidationError, hidden: Collection[str] = ()) -> tuple[str, str]:
    """Message and hint for the first wrong key."""
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if part not in hidden)
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"has the unknown key {key}", "take it out, or check how it is written"
    if first["type"] == "missing":
        return f"lacks the key {key}", "add it"
    if first["type"].startswith("union_tag"):
        tag, place = first["ctx"]["discriminator"].strip("'"), f" in [{key}]" if key else ""
        value = first["input"].get(tag) if isinstance(first["input"], Mapping) else first["input"]
        says = f"has the {tag} {shown(value)}{place}" if value else f"has no {tag}{place}"
        tags = first["ctx"].get("expected_tags")
        return says, f"write {tag} = one of {tags}" if tags else f"add {tag}"
    mend = advice(first)
    if (
        first["type"] == "value_error"
    ):  # concerns a whole table: too long to show, and the message names the keys
        return f"is invalid{f' in [{key}]' if key else ''}: {mend}", "correct it"
    return f"says {key} = {shown(first.get('input'))}", f"correct it: {mend}"


_WANTED = {
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "string": "text",
    "tuple": "a list",
    "dict": "a table of names and values",
}
_BOUNDS = {"gt": "above", "ge": "of at least", "lt": "below", "le": "of at most"}


def advice(error: ErrorDetails) -> str:
    """Advice about a value that pydantic refuses."""
    kind, limits = error["type"], error.get("ctx", {})
    if kind == "literal_error":
        return f"write {limits['expected']}"
    if bound := next((name for name in _BOUNDS if name in limits), ""):
        return f"write a number {_BOUNDS[bound]} {limits[bound]:g}"
    if kind == "finite_number":
        return "write a finite number"
    if wanted := _WANTED.get(kind.partition("_")[0]):
        return f"write {wanted}"
    message = error["msg"].removeprefix("Value error, ")
    return f"{message[:1].lower()}{message[1:]}"


def write_toml(path: Path, model: BaseModel, *, heading: str = "") -> None:
    """Write a model as TOML without None values, whole or not at all. Raises FileError: it cannot be written."""
    write_text(path, heading + toml_text(model.model_dump(mode="json", exclude_none=True)))
