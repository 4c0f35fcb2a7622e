"""Settings of the command line: flags over environment over file over defaults.

tactile-marks.toml      font = ["gothic"]               (working folder, or the file after --config)
                        [service]
                        port = 8417
environment             TACTILE_MARKS_HEIGHT_MM=5, TACTILE_MARKS_SERVICE_PORT=8417
flags                   --height-mm 5, serve --port 8417
job                     read --job housing-left.toml    (in place of environment and file; flags override it)

A command has a parameter of type `Reading`, `Workers` or `Service`, and one `config`. A command that has flags for the
usual settings only has `Parts` and `ReadingOfFile`, which `with_flags` joins. An unknown key is an error.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import textwrap
from collections.abc import Iterator, Sequence
from operator import attrgetter
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import pydantic
from cyclopts import App, CycloptsError, Group, Parameter
from cyclopts.argument import Argument, ArgumentCollection, Token
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from glyphs.errors import FileError
from pipeline.common.job_file import read_job_file
from pipeline.common.parsed import shown, toml_of
from pipeline.common.settings import (
    MapSettings,
    PartSettings,
    ReadSettings,
    Settings,
    SettingsError,
    bad_value,
)
from pipeline.service.settings import ServiceSettings
from pipeline.workers.options import PoolSettings, WorkerSettings

S = TypeVar("S", bound=Settings)
DEFAULT_FILE = Path("tactile-marks.toml")
MODELS: tuple[type[Settings], ...] = (ReadSettings, WorkerSettings, ServiceSettings)
_BEGINNING = """\
# Settings of tactile-marks. Those at their defaults are commented out: remove the # before a name to set it.
# Environment variables and flags override this file; `tactile-marks serve --help-all` names them.
"""
_ALIKE = 0.75  # likeness of names (difflib's ratio) from which one counts as a misspelling of the other
_TYPES = {
    bool: "true or false",
    str: "text",
    int: "whole number",
    float: "number",
    Path: "file or folder",
    dict: "table",
}


def _flags(title: str, model: type[Settings], setting: str, example: str) -> Parameter:
    variable = model.variable(setting)
    where = f"Also in tactile-marks.toml, {example}, and in the environment, {variable}=..."
    return Parameter(name="*", group=Group(title, help=where))


Reading = Annotated[ReadSettings, _flags("Settings of reading", ReadSettings, "height_mm", "height_mm = 5.0")]
_OF_WORKERS = _flags("Settings of the workers", WorkerSettings, "jobs", "under [workers]")
Workers = Annotated[WorkerSettings, _OF_WORKERS]
Pool = Annotated[PoolSettings, _OF_WORKERS]
Service = Annotated[
    ServiceSettings, _flags("Settings of the service", ServiceSettings, "port", "under [service]")
]
Parts = Annotated[
    PartSettings,
    Parameter(
        name="*",
        group=Group(
            "Settings of reading",
            help="The others are in tactile-marks.toml, in the environment, TACTILE_MARKS_REGION=..., and in jobs.",
        ),
    ),
]
Maps = Annotated[MapSettings, Parameter(name="*", group=Group("Settings of height files"))]
# from file and environment only, for commands whose flags mean something else
ReadingOfFile = Annotated[ReadSettings, Parameter(name="reading", show=False)]
ServiceOfFile = Annotated[ServiceSettings, Parameter(name="service", show=False)]
WorkersOfFile = Annotated[WorkerSettings, Parameter(name="workers", show=False)]
Config = Annotated[
    Path | None,
    Parameter(
        help="TOML file with settings (default: tactile-marks.toml in the working folder, if it exists)."
    ),
]
JobPath = Annotated[
    Path | None,
    Parameter(
        help="Job file: settings of reading, in place of those of the environment and of tactile-marks.toml; flags "
        "override it."
    ),
]
READING, WORKERS, SERVICE, MAPS = ReadSettings(), WorkerSettings(), ServiceSettings(), MapSettings()
PARTS, POOL = PartSettings(), PoolSettings()


def from_file_and_environment(_: App, __: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Fill in settings from environment and file that have no flag on the command line. Raises SettingsError: the file
    cannot be read or has unknown keys, a job and a settings file are both given, or the database is missing. FileError:
    the job cannot be used."""
    config, job = (
        next((Path(a.tokens[0].value) for a in arguments if a.name == flag and a.tokens), None)
        for flag in ("--config", "--job")
    )
    if job is not None and config is not None:
        raise SettingsError("--job and --config both say how to read", hint="name one of them")
    file = config or DEFAULT_FILE
    written = _toml_of(file) if config is not None or file.is_file() else {}
    for argument in (a for a in arguments if a.hint in MODELS):
        fields = _leaves(argument)
        if argument.hint is ReadSettings and job is not None:
            settings_of_job = read_job_file(job).settings.model_dump(exclude_unset=True)
            values = [(name, value, f"{name} in {job}") for name, value in settings_of_job.items()]
        else:
            values = [*_of_environment(argument.hint), *_of_file(argument.hint, file, written)]
        for name, value, source in values:
            if not fields[name].has_tokens:
                _give(fields[name], argument.hint.leaves()[name], value, source)
        for token in fields["database"].tokens if argument.hint is ReadSettings else ():
            if not Path(token.value).exists():
                by = "" if token.source == "cli" else f", named by {token.source},"
                raise SettingsError(f"{token.value}{by} is not there", hint="check the name")


def with_flags(settings: S, *flags: Settings) -> S:
    """Settings from file and environment, with those that have a flag on the command line."""
    flagged = {name: value for group in flags for name, value in group if name in group.model_fields_set}
    return settings.model_copy(update=flagged)


def explained(error: CycloptsError) -> str:
    """Explain an error of a command line, an environment or a file in one line."""
    cause = error.__cause__
    if not isinstance(cause, pydantic.ValidationError):
        return str(error)
    fields = _leaves(error.argument) if error.argument is not None else {}
    sources = {name: field.tokens[0].source for name, field in fields.items() if field.tokens}
    elsewhere = {name: source for name, source in sources.items() if source != "cli"}
    return str(bad_value(cause, called=lambda name: elsewhere.get(name, _flag_of(name))))


def _flag_of(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def unknown_flag_hint(unknown: str, flags: Sequence[str]) -> str:
    """A sentence on what an unknown flag may mean; empty if that is unclear.

    It may be a former name, a setting without a flag, one written with its table's name, or a misspelling.
    """
    name = unknown[2:].replace("-", "_")
    for model in MODELS:
        written = model.replaced.get(name, "")
        if written and _flag_of(written.split()[0]) in flags:
            setting, _, value = written.partition(" = ")
            return f"Did you mean {f'{_flag_of(setting)} {value}'.rstrip()}?"
        if unknown not in flags and name in model.leaves():
            return (
                f"Set {f'{model.table}.{name}'.lstrip('.')} in {DEFAULT_FILE} or as {model.variable(name)}."
            )
        plain = re.sub(rf"^--{model.table}[.-]", "--", unknown) if model.table else unknown
        if plain in flags:
            return f"Did you mean {plain}?"
    first_word = [flag for flag in flags if flag[2:].split("-")[0] == unknown[2:].split("-")[0]]
    near = (*difflib.get_close_matches(unknown, flags, n=1, cutoff=_ALIKE), *first_word)
    return f"Did you mean {near[0]}?" if near else ""


def _leaves(argument: Argument, within: str = "") -> dict[str, Argument]:
    leaves: dict[str, Argument] = {}
    for child in argument.children:
        name = f"{within}{child.keys[-1]}"
        leaves |= _leaves(child, f"{name}.") if child.children else {name: child}
    return leaves


def _give(field: Argument, declared: FieldInfo, value: Any, source: str) -> None:
    for check in declared.metadata:
        if isinstance(check, pydantic.BeforeValidator):
            try:
                value = check.func(value)  # type: ignore[call-arg]
            except ValueError as error:
                raise SettingsError(f"{source} is {shown(value)}: {error}") from error
    for index, item in enumerate(value if isinstance(value, (list, tuple)) else (value,)):
        try:
            text = json.dumps(item) if isinstance(item, (dict, list)) else str(item)
        except ValueError as error:
            raise SettingsError(f"{source} is {shown(value)}", hint="correct it") from error
        field.append(Token(keyword=".".join(field.keys), value=text, source=source, index=index))


def _of_environment(model: type[Settings]) -> Iterator[tuple[str, str, str]]:
    prefix = model.variable("")
    names = {model.variable(name): name for name in (*model.replaced, *model.leaves())}
    others = tuple(
        other.variable("") for other in MODELS if other.variable("").startswith(prefix) and other is not model
    )
    for variable, value in os.environ.items():
        if variable.upper().startswith(prefix) and not variable.upper().startswith(others):
            name = names.get(variable.upper(), variable[len(prefix) :].lower())
            model.check_known(name, called=variable, where="the environment")
            yield name, value, variable


def _of_file(model: type[Settings], file: Path, written: dict[str, Any]) -> Iterator[tuple[str, Any, str]]:
    tables = {other.table for other in MODELS}
    table = (
        written.get(model.table, {}) if model.table else {k: v for k, v in written.items() if k not in tables}
    )
    for name, value in _flat(table, model, file, model.table):
        others = [other.table for other in MODELS if other.table != model.table and name in other.leaves()]
        if others and name not in model.leaves():
            place = f"under [{others[0]}]" if others[0] else "above the first table"
            raise SettingsError(f"{name} in {file} is in the wrong place", hint=f"write it {place}")
        if isinstance(value, dict) and name not in model.leaves():
            for key in value:
                if f"{name}.{key}" in model.replaced:
                    model.check_known(f"{name}.{key}", where=str(file))
            raise _unknown_section(f"{model.table}.{name}".removeprefix("."), file)
        model.check_known(name, where=str(file))
        yield name, value, f"{name} in {file}"


def _unknown_section(name: str, file: Path) -> SettingsError:
    leaves = {f"{model.table}.{leaf}" for model in MODELS if model.table for leaf in model.leaves()}
    sections = sorted({leaf.rpartition(".")[0] for leaf in leaves} | {"line"})
    name_alone = name.rpartition(".")[2]
    near = [section for section in sections if section.rpartition(".")[2] == name_alone]
    near = near or difflib.get_close_matches(name, sections, n=1, cutoff=_ALIKE)
    known = ", ".join(f"[{section}]" for section in sections)
    hint = f"did you mean [{near[0]}]?" if near else f"the sections are {known}"
    return SettingsError(f"unknown section [{name}] in {file}", hint=hint)


def _flat(written: Any, model: type[Settings], file: Path, place: str) -> Iterator[tuple[str, Any]]:
    """The settings of a table and its sections, by name; `place` is the table's own name."""
    if not isinstance(written, dict):
        name = place.rpartition(".")[2]
        raise SettingsError(f"{name} in {file} is {shown(written)}", hint=f"make it a table: [{place}]")
    for key, value in written.items():
        section = model.model_fields[key].annotation if key in model.model_fields else None
        if isinstance(section, type) and issubclass(section, Settings):
            below = _flat(value, section, file, f"{place}.{key}")
            yield from ((f"{key}.{name}", setting) for name, setting in below)
        else:
            yield key, value


def _toml_of(file: Path) -> dict[str, Any]:
    try:
        return toml_of(file)
    except FileError as error:
        raise SettingsError(f"{file} {error.what}", hint=error.hint) from error


def settings(
    out: Path | None = None,
    /,
    *,
    reading: ReadingOfFile = READING,
    workers: WorkersOfFile = WORKERS,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> None:
    """Print every setting with its value, as a settings file, and the limits that follow from this machine.

    Settings at their defaults are commented out.

    Args:
        out: File to write instead, such as tactile-marks.toml. An existing file is not overwritten.
    """
    text = f"{settings_file(reading, workers, service)}\n{_from_machine(workers, service)}"
    if out is None:
        print(text, end="")
        return
    from pipeline.common.output_paths import write_text

    if os.path.lexists(out):
        raise SettingsError(f"settings: {out} is there already", hint="name another file")
    write_text(out, text)
    print(f"wrote {out}")


def settings_file(*models: Settings) -> str:
    """A `tactile-marks.toml` with every setting; those at their defaults are commented out.

    Explanations begin with "# ", settings with "#" alone; without the # the line takes effect. There are no tables, so
    that other lines can be pasted anywhere. A setting without a default has its type in place of a value:

    # Private key of that certificate (PEM), without a password.
    #service.tls.key =    # file or folder
    """
    return "\n".join((_BEGINNING, *map(_table_of_file, models)))


def _table_of_file(model: Settings) -> str:
    written = []
    for path, field in model.leaves().items():
        name = f"{model.table}.{path}".lstrip(".")
        lines = textwrap.wrap(str(field.description), 98, break_on_hyphens=False)
        default = to_jsonable_python(field.get_default(call_default_factory=True))
        value = to_jsonable_python(attrgetter(path)(model))
        if value != default:
            setting = f"{name} = {json.dumps(value)}"
        elif default is None or (field.default_factory is not None and default):
            setting = f"#{name} =    # {_type(field.annotation)}"
        else:
            setting = f"#{name} = {json.dumps(default)}"
        written.append("".join(f"# {line}\n" for line in lines) + f"{setting}\n")
    return "\n".join(written)


def _from_machine(workers: WorkerSettings, service: ServiceSettings) -> str:
    from pipeline.service.connections import connections_of_address, most_connections
    from pipeline.workers.machine import Machine

    machine, most = Machine.of(workers.processes), most_connections()
    return f"""\
# What the service takes from this machine, for {workers.processes} processes that read:
# memory of each process             {machine.worker_memory_mb:,} MB
# parts that wait for a process      {machine.waiting_parts:,}
# largest photograph                 {machine.files.photo_pixels:,} pixels
# largest height map                 {machine.files.map_samples:,} samples
# largest request                    {machine.upload_bytes:,} bytes
# connections, of one address        {most:,}, {connections_of_address(most):,}
"""


def _type(annotation: Any) -> str:
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
