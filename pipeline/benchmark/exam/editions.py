"""The named editions of the exam: designs that come with the program."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from pipeline.benchmark.exam.design import Design, PackagedFont
from pipeline.common.parsed import toml_of
from pipeline.common.settings import SettingsError

_ROOM = Path(str(files("pipeline.benchmark.exam")))
_DESIGNS = _ROOM / "designs"


def editions() -> tuple[str, ...]:
    """Names of the editions."""
    return tuple(sorted(path.stem for path in _DESIGNS.glob("*.toml")))


def design_named(name: str) -> Design:
    """An edition by its name, or a design from a TOML file; either may name fonts of the editions.

    Raises:
        FileError: the file is not a design.
        SettingsError: neither a file nor an edition.
    """
    if name not in editions() and not name.endswith(".toml"):
        raise SettingsError(
            f"there is no design {name!r}", hint=f"name a TOML file, or one of {', '.join(editions())}"
        )
    design = Design.load(Path(name) if name.endswith(".toml") else _DESIGNS / f"{name}.toml")
    known = toml_of(_ROOM / "fonts.toml")
    packaged = {font: PackagedFont(**known[font]) for font in design.font_names if font in known}
    return design.model_copy(update={"fonts": {**packaged, **design.fonts}})
