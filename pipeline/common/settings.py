"""How to read: from a TOML file, the environment and the flags, the later over the former.

    tactile-marks.toml      font = ["gothic"]               (working folder, or the file after --config)
                            height_mm = 5.0
    environment             TACTILE_MARKS_HEIGHT_MM=5       (fonts and check digits separated by commas)
    flags                   --height-mm 5

A key that is not known is an error wherever it stands.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from pipeline.common.setting_sources import ENV_PREFIX, SettingsError, load

__all__ = ["ENV_PREFIX", "ReadSettings", "SettingsError", "load_settings"]


class ReadSettings(BaseSettings):
    """Settings of reading, checked.

    Attributes:
        font: names of built-in fonts or paths of font files; none: every built-in font competes.
        format: what serials look like, as in `recognition.format_text`; all must hold. The environment gives one.
        lexicon: file of the serials that there are, one a line.
        check: check digits that must hold, as in `recognition.check_digits`.
        exclude: characters that no serial has, but where a mask writes them itself.
        height_mm: character height; found out if not given.
        mode: senses that read (`pipeline.reading.part_reader`); not given: touch, or the camera for a photograph alone.
        accept_confidence: least confidence of a reading that is accepted; the reader's own unless given.
        accept_margin: least lead of the first over the second candidate for it; likewise.
        fidelity: how touch is simulated, for height maps and templates.
        database: glyph database to take the fonts from.
        depth_rule: name of a rule that the mark's depth and size must meet, such as 27CFR478.92.
        min_depth_mm: depth that the mark must have everywhere.
    """

    model_config = SettingsConfigDict(env_prefix=ENV_PREFIX, extra="forbid", frozen=True)

    font: Annotated[tuple[str, ...], NoDecode] = ()
    format: Annotated[tuple[str, ...], NoDecode] = ()
    lexicon: Path | None = None
    check: Annotated[tuple[str, ...], NoDecode] = ()
    exclude: str = ""
    height_mm: float | None = Field(default=None, gt=0.0, le=1000.0, allow_inf_nan=False)
    mode: Literal["tactile", "vision", "fused", "auto"] | None = None
    accept_confidence: float | None = Field(default=None, ge=0.0, le=1.0, allow_inf_nan=False)
    accept_margin: float | None = Field(default=None, ge=0.0, le=1.0, allow_inf_nan=False)
    fidelity: Literal["pointwise", "contact"] = "contact"
    database: Path | None = None
    depth_rule: str | None = None
    min_depth_mm: float | None = Field(default=None, gt=0.0, le=100.0, allow_inf_nan=False)

    @field_validator("depth_rule")
    @classmethod
    def _known_rule(cls, value: str | None) -> str | None:
        from recognition.depth_rules import depth_rule

        return None if value is None else depth_rule(value).name

    @field_validator("format", mode="before")
    @classmethod
    def _one_format_or_many(cls, value: Any) -> Any:
        # a format may hold commas itself
        return (value,) if isinstance(value, str) else value

    @field_validator("format")
    @classmethod
    def _known_formats(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        from recognition.grammar import Grammar

        for text in value:
            Grammar.parse(text)
        return value

    @field_validator("check")
    @classmethod
    def _known_checks(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        from recognition.check_digits import CheckDigit

        for text in value:
            CheckDigit.parse(text)
        return value

    @field_validator("exclude")
    @classmethod
    def _characters(cls, value: str) -> str:
        if any(c.isspace() or not c.isprintable() for c in value):
            raise ValueError("it has a blank; write the characters one after the other: IOQ")
        return value

    @field_validator("font", "check", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        if isinstance(value, str):
            return tuple(name.strip() for name in value.split(",") if name.strip())
        return value


def load_settings(*, config: Path | None = None, folder: Path | None = None, **flags: Any) -> ReadSettings:
    """The settings in force.

    Args:
        config: TOML file; without it `tactile-marks.toml` in the folder, if there is one.
        folder: working folder, the current one unless given.
        flags: by field name; None is not given.

    Raises:
        SettingsError: unknown keys, values that cannot be, a file that cannot be read.
    """
    return load(ReadSettings, config=config, folder=folder, flags=flags)
