"""The named editions of the exam: designs that come with the program."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from pipeline.benchmark.exam.design import Design
from pipeline.common.settings import SettingsError

_DESIGNS = files("pipeline.benchmark.exam") / "designs"


def editions() -> tuple[str, ...]:
    """Their names."""
    return tuple(
        sorted(Path(entry.name).stem for entry in _DESIGNS.iterdir() if entry.name.endswith(".toml"))
    )


def design_named(name: str) -> Design:
    """An edition by its name, or a design from a TOML file.

    Raises:
        FileError: the file is not a design.
        SettingsError: neither a file nor an edition.
    """
    if name in editions():
        return Design.load(Path(str(_DESIGNS / f"{name}.toml")))
    if name.endswith(".toml"):
        return Design.load(Path(name))
    raise SettingsError(
        f"there is no design {name!r}",
        hint=f"name a TOML file, or one of {', '.join(editions()) or 'none yet'}",
    )
