"""Conditions of a trial: the factors of a part, and what the reader was given beside the part.

part      soil  severity  font  format  height_mm  die  plate  ...        what was made
given     font_given  height_given  format_given                          what the reader knew of it
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from glyphs.surface.display import one_line
from pipeline.common.settings import SettingsError

Level = str | float | bool | None
"""One setting of a factor; None where it is not known."""
GIVEN = ("font", "height", "format")
PERTURBED = "perturbed"
"""The factor that tells how a part was perturbed for a trial; one that was read as it is does not have it."""


@dataclass(frozen=True)
class Given:
    """Knowledge that a reader is given with the part.

    Attributes:
        font: the font of the mark; else it may be any built-in one.
        height: the character height.
        format: the form of the serials.
    """

    font: bool = False
    height: bool = False
    format: bool = True

    __repr__ = one_line

    @classmethod
    def parse(cls, text: str) -> Given:
        """From `font,height,format`, or some of these, or `nothing`.

        Raises:
            SettingsError: another word.
        """
        words = [word.strip() for word in text.split(",") if word.strip() and word.strip() != "nothing"]
        for word in words:
            if word not in GIVEN:
                raise SettingsError(
                    f"a reader cannot be given {word!r}", hint=f"name some of {', '.join(GIVEN)}, or nothing"
                )
        return cls(**{name: name in words for name in GIVEN})

    @property
    def levels(self) -> dict[str, Level]:
        """As factors of a trial."""
        return {f"{name}_given": getattr(self, name) for name in GIVEN}

    def __str__(self) -> str:
        return ",".join(name for name in GIVEN if getattr(self, name)) or "nothing"


class Condition(dict[str, Level]):
    """The levels of all factors of a part, by name; a factor that is not there is not known."""

    @property
    def severity(self) -> float | None:
        """Severity of the dirt, 0 to 1; None if not known."""
        level = self.get("severity")
        return None if level is None else float(level)

    @property
    def font(self) -> str:
        """Font of the mark: built-in name or file; empty if not known."""
        return str(self.get("font") or "")

    @property
    def format(self) -> str:
        """Format of the serial; empty if not known."""
        return str(self.get("format") or "")

    @property
    def height_mm(self) -> float | None:
        """Height of the characters; None if not known."""
        level = self.get("height_mm")
        return None if level is None else float(level)

    @property
    def levels(self) -> dict[str, Level]:
        """As factors of a trial: a font by its name, whatever folder its file is in."""
        return {n: font_name(str(v)) if n == "font" and v else v for n, v in self.items()}


def font_name(font: str) -> str:
    """A font without the folder and suffix of its file."""
    return Path(font).stem if "/" in font or "." in font else font


def level_name(level: Level) -> str:
    """Write a level."""
    if level is None:
        return "not known"
    if isinstance(level, bool):
        return "yes" if level else "no"
    return f"{level:g}" if isinstance(level, int | float) else str(level)
