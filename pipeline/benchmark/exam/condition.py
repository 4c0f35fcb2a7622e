"""Conditions of a trial: factors of a part, and facts given to the reader (font_given, height_given, format_given)."""

from __future__ import annotations

from pathlib import Path

from pipeline.common.settings import SettingsError
from pipeline.common.texts import split_commas

# one setting of a factor; None if unknown
Level = str | float | bool | None
GIVEN = ("font", "height", "format")
# factor for the perturbation of a part; an unperturbed part does not have it
PERTURBED = "perturbed"


def parse_given(text: str) -> str:
    """The facts given to a reader: some of `font,height,format`, or `nothing`. Raises SettingsError: others."""
    words = [word for word in split_commas(text) if word != "nothing"]
    for word in words:
        if word not in GIVEN:
            hint = f"name some of {', '.join(GIVEN)}, or nothing"
            raise SettingsError(f"a reader cannot be given {word!r}", hint=hint)
    return ",".join(name for name in GIVEN if name in words) or "nothing"


def given_levels(facts: str) -> dict[str, Level]:
    """The given facts as factors of a trial."""
    return {f"{name}_given": name in facts.split(",") for name in GIVEN}


class Condition(dict[str, Level]):
    """The levels of all factors of a part, by name; a missing factor is unknown."""

    @property
    def severity(self) -> float | None:
        return self._number("severity")

    @property
    def font(self) -> str:
        return str(self.get("font") or "")

    @property
    def format(self) -> str:
        return str(self.get("format") or "")

    @property
    def height_mm(self) -> float | None:
        return self._number("height_mm")

    @property
    def levels(self) -> dict[str, Level]:
        return {n: font_name(str(v)) if n == "font" and v else v for n, v in self.items()}

    def _number(self, factor: str) -> float | None:
        level = self.get(factor)
        return None if level is None else float(level)


def font_name(font: str) -> str:
    """Name of a font, without the folder and suffix of its file."""
    return Path(font).stem if "/" in font or "." in font else font


def level_name(level: Level) -> str:
    """A level as text."""
    if level is None:
        return "not known"
    if isinstance(level, bool):
        return "yes" if level else "no"
    return f"{level:g}" if isinstance(level, int | float) else str(level)
