"""Settings of the command line: flags over environment over file over defaults.

tactile-marks.toml      font = ["gothic"]               (working folder, or the file after --config)
                        [service]
                        port = 8417
environment             TACTILE_MARKS_HEIGHT_MM=5, TACTILE_MARKS_SERVICE_PORT=8417
flags                   --height-mm 5, serve --port 8417
job                     read --job housing-left.toml    (in place of environment and file; flags go over it)

A command has a parameter of type `Reading`, `Workers` or `Service`, and one `config`. An unknown key is an error.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import pydantic
from cyclopts import App, CycloptsError, Group, Parameter
from cyclopts.argument import Argument, ArgumentCollection, Token

from glyphs.errors import FileError
from pipeline.common.job_file import read_job_file
from pipeline.common.parsed import shown, toml_of
from pipeline.common.settings import MapSettings, ReadSettings, Settings, SettingsError, bad_value
from pipeline.service.settings import ServiceSettings
from pipeline.workers.options import WorkerSettings

DEFAULT_FILE = Path("tactile-marks.toml")
MODELS: tuple[type[Settings], ...] = (ReadSettings, WorkerSettings, ServiceSettings)
_HELP = "Also in tactile-marks.toml, {example}, and in the environment, {variable}=..."

Reading = Annotated[
    ReadSettings,
    Parameter(
        name="*",
        group=Group(
            "Settings of reading",
            help=_HELP.format(example="height_mm = 5.0", variable=ReadSettings.variable("height_mm")),
        ),
    ),
]
Workers = Annotated[
    WorkerSettings,
    Parameter(
        name="*",
        group=Group(
            "Settings of the workers",
            help=_HELP.format(example="under [workers]", variable=WorkerSettings.variable("jobs")),
        ),
    ),
]
Service = Annotated[
    ServiceSettings,
    Parameter(
        name="*",
        group=Group(
            "Settings of the service",
            help=_HELP.format(example="under [service]", variable=ServiceSettings.variable("port")),
        ),
    ),
]
Maps = Annotated[MapSettings, Parameter(name="*", group=Group("Settings of height files"))]
ReadingOfFile = Annotated[ReadSettings, Parameter(name="reading", show=False)]
"""For a command whose flags mean something else: settings from file and environment."""
ServiceOfFile = Annotated[ServiceSettings, Parameter(name="service", show=False)]
"""Likewise."""
Config = Annotated[
    Path | None,
    Parameter(help="TOML file with settings; tactile-marks.toml in the working folder is read by itself."),
]
JobPath = Annotated[
    Path | None,
    Parameter(
        help="Job file: settings of reading, in place of those of the environment and of tactile-marks.toml; flags "
        "beside it go over it."
    ),
]
READING, WORKERS, SERVICE, MAPS = ReadSettings(), WorkerSettings(), ServiceSettings(), MapSettings()


def from_file_and_environment(_: App, __: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Give a command what environment and file say of its settings where its flags say nothing.

    Raises:
        SettingsError: a file that cannot be read, unknown keys, a job beside a file of settings.
        FileError: a job that cannot be used.
    """
    job = _path_given(arguments, "--job")
    if job is not None and _path_given(arguments, "--config") is not None:
        raise SettingsError("--job and --config both say how to read", hint="name one of them")
    written: dict[str, Any] | None = None
    for argument in arguments:
        model = argument.hint
        if model not in MODELS:
            continue
        if model is ReadSettings:
            _check_database(_leaves(argument).get("database"))
        if model is ReadSettings and job is not None:
            for name, value in read_job_file(job).settings.model_dump(exclude_unset=True).items():
                _give(argument, name, value, f"{name} in {job}")
            continue
        if written is None:
            file, written = _read_file(arguments)
        for name, variable in _variables(model):
            model.check_known(name, called=variable, where="the environment")
            _give(argument, name, os.environ[variable], variable)
        for name, value in _of_table(written, model, file).items():
            model.check_known(name, where=str(file))
            _give(argument, name, value, f"{name} in {file}")


def _check_database(given: Argument | None) -> None:
    if given is not None and given.tokens and not Path(name := given.tokens[0].value).exists():
        raise SettingsError(f"{name}: is not there", hint="check the name")


def explained(error: CycloptsError) -> str:
    """Explain an error of a command line, an environment or a file in one line."""
    cause = error.__cause__
    if not isinstance(cause, pydantic.ValidationError):
        return str(error)
    fields = _leaves(error.argument) if error.argument is not None else {}
    sources = {name: field.tokens[0].source for name, field in fields.items() if field.tokens}
    elsewhere = {name: source for name, source in sources.items() if source != "cli"}
    return str(bad_value(cause, called=lambda name: elsewhere.get(name, flag_of(name))))


def flag_of(name: str) -> str:
    """The flag of a setting."""
    return f"--{name.replace('_', '-')}"


def _leaves(argument: Argument, within: str = "") -> dict[str, Argument]:
    """The arguments of a model's settings by name."""
    found: dict[str, Argument] = {}
    for child in argument.children:
        name = f"{within}{child.keys[-1]}"
        found |= _leaves(child, f"{name}.") if child.children else {name: child}
    return found


def _give(argument: Argument, name: str, value: Any, source: str) -> None:
    field = _leaves(argument)[name]
    if field.has_tokens:
        return
    for check in argument.hint.leaves()[name].metadata:
        if isinstance(check, pydantic.BeforeValidator):
            try:
                value = check.func(value)  # type: ignore[call-arg]
            except ValueError as error:
                raise SettingsError(f"{source} is {shown(value)}: {error}") from error
    values = value if isinstance(value, (list, tuple)) else (value,)
    for index, item in enumerate(values):
        try:
            text = json.dumps(item) if isinstance(item, (dict, list)) else str(item)
        except ValueError as error:
            raise SettingsError(f"{source} is {shown(value)}", hint="correct it") from error
        field.append(Token(keyword=name, value=text, source=source, index=index))


def _variables(model: type[Settings]) -> Iterator[tuple[str, str]]:
    """Settings that the environment gives, and their variables."""
    names = {model.variable(name): name for name in model.leaves()}
    prefix = model.variable("")
    others = tuple(
        other.variable("") for other in MODELS if other.variable("").startswith(prefix) and other is not model
    )
    for variable in os.environ:
        if variable.upper().startswith(prefix) and not variable.upper().startswith(others):
            yield names.get(variable.upper(), variable[len(prefix) :].lower()), variable


def _of_table(written: dict[str, Any], model: type[Settings], file: Path) -> dict[str, Any]:
    if not model.table:
        return {key: value for key, value in written.items() if key not in {other.table for other in MODELS}}
    return dict(_flat(written.get(model.table, {}), model, file, model.table))


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


def _path_given(arguments: ArgumentCollection, flag: str) -> Path | None:
    return next((Path(a.tokens[0].value) for a in arguments if a.name == flag and a.tokens), None)


def _read_file(arguments: ArgumentCollection) -> tuple[Path, dict[str, Any]]:
    named = _path_given(arguments, "--config")
    file = named or DEFAULT_FILE
    if named is None and not file.is_file():
        return file, {}
    try:
        return file, toml_of(file)
    except FileError as error:
        raise SettingsError(f"{file} {error.what}", hint=error.hint) from error
