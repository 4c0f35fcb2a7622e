"""Where settings come from: a TOML file, the environment, the flags; the later over the former.

The settings of reading stand at the top of the file, those of the service in its table `[service]`; in the
environment TACTILE_MARKS_HEIGHT_MM is of reading, TACTILE_MARKS_SERVICE_PORT of the service.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource

from glyphs.errors import MarksError

ENV_PREFIX = "TACTILE_MARKS_"
TABLES = ("service",)
"""Tables of the file, each with settings, and a stretch of the environment, of its own."""
DEFAULT_FILE = "tactile-marks.toml"
S = TypeVar("S", bound=BaseSettings)


class SettingsError(MarksError):
    """A setting that cannot be: names the key, where it stands."""


def load(
    model: type[S],
    *,
    table: str = "",
    config: Path | None = None,
    folder: Path | None = None,
    flags: Mapping[str, Any],
) -> S:
    """The settings in force.

    Args:
        model: what they are.
        table: of the file; those at its top unless given.
        config: TOML file; without it `tactile-marks.toml` in the folder, if there is one.
        folder: working folder, the current one unless given.
        flags: by field name; None is not given.

    Raises:
        SettingsError: unknown keys, values that cannot be, a file that cannot be read.
    """
    file = config if config is not None else (folder or Path()) / DEFAULT_FILE
    whole = _read_toml(file) if config is not None or file.is_file() else {}
    written = _of_table(whole, table, file)
    given = {key: value for key, value in flags.items() if value is not None}
    environment = _of_environment(table)
    for keys, where in ((written, str(file)), (environment, "the environment"), (given, "the flags")):
        for key in keys:
            _check_known(model, key, where, shown=environment[key] if keys is environment else key)

    class Sources(model):  # type: ignore[misc,valid-type]
        @classmethod
        def settings_customise_sources(
            cls,
            settings_cls: type[BaseSettings],
            init_settings: PydanticBaseSettingsSource,
            env_settings: PydanticBaseSettingsSource,
            dotenv_settings: PydanticBaseSettingsSource,
            file_secret_settings: PydanticBaseSettingsSource,
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            return init_settings, env_settings, InitSettingsSource(settings_cls, written)

    try:
        return model(**Sources(**given).model_dump())
    except ValidationError as error:
        first = error.errors()[0]
        message = first["msg"].removeprefix("Value error, ")
        if not first["loc"]:
            raise SettingsError(message) from error
        key = str(first["loc"][0])
        where = "the flags" if key in given else environment.get(key, str(file))
        message = message[:1].lower() + message[1:]
        raise SettingsError(f"{key} in {where} is {first.get('input')!r}: {message}") from error


def _of_table(whole: dict[str, Any], table: str, file: Path) -> dict[str, Any]:
    if not table:
        return {key: value for key, value in whole.items() if key not in TABLES}
    held = whole.get(table, {})
    if not isinstance(held, dict):
        raise SettingsError(f"{table} in {file} is {held!r}", hint=f"make it a table: [{table}]")
    return held


def _of_environment(table: str) -> dict[str, str]:
    """Keys that the environment sets, and the names of the variables."""
    others = tuple(f"{ENV_PREFIX}{name}_".upper() for name in TABLES if name != table)
    prefix = f"{ENV_PREFIX}{table}_".upper() if table else ENV_PREFIX
    found = [key for key in os.environ if key.upper().startswith(prefix)]
    return {
        key[len(prefix) :].lower(): key for key in found if not (not table and key.upper().startswith(others))
    }


def _check_known(model: type[BaseSettings], key: str, where: str, *, shown: str) -> None:
    known = list(model.model_fields)
    if key not in known:
        near = difflib.get_close_matches(key.lower(), known, n=2)
        hint = f"did you mean {' or '.join(near)}?" if near else f"the keys are {', '.join(known)}"
        raise SettingsError(f"unknown key {shown} in {where}", hint=hint)


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(
            f"{file} cannot be read ({error.strerror})", hint="check the name after --config"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{file} is no TOML ({error})", hint="mend that line") from error
