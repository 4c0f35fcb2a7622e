"""The design of an exam: its parts, and the facts that readers are given; a TOML file describes it::

    name = "two-soils"
    seed = 1
    parts = 240
    cross = ["soil", "severity"]        # every combination equally often; the other factors are balanced
    given = ["format", "font,format"]   # every part is read with each of these

    [part]                              # levels of each factor; a single level is a constant
    soil = ["rust", "paint"]
    severity = [0.3, 0.6, 0.9]

Balanced means: the replicates of a cell take the levels of every other factor in turn, in an order drawn once, so that
in every section, and of the first N parts, the numbers of parts at two levels of a factor differ by at most 1.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from glyphs.soiling.soiled import WORKSHOP
from pipeline.benchmark.exam.condition import Condition, Level, level_name, parse_given
from pipeline.benchmark.exam.font_packages import PackagedFont
from pipeline.common.parsed import toml_of, wrong_key
from pipeline.common.settings import SettingsError
from pipeline.errors import naming
from pipeline.formats.synth import MAX_PARTS

_ROOM = Path(str(files("pipeline.benchmark.exam")))
_DESIGNS = _ROOM / "designs"


def _levels(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    return {k: tuple(v) if isinstance(v, list | tuple) else (v,) for k, v in value.items()}


Part = Annotated[dict[str, tuple[str | bool | float, ...]], BeforeValidator(_levels)]


class Section(BaseModel):
    """Consecutive parts with their own levels; nothing here may be fitted to `kept_out` fonts."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = ""
    parts: int = Field(ge=1, le=MAX_PARTS)
    kept_out: bool = False
    part: Part = {}


class Design(BaseModel):
    """The parts of an exam, and the facts that readers are given."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = "benchmark"
    about: str = ""
    seed: int = Field(default=1, ge=0)
    parts: int = Field(default=0, ge=0, le=MAX_PARTS)  # give this, `parts_a_cell` or `sections`
    parts_a_cell: int = Field(default=0, ge=0, le=MAX_PARTS)
    cross: tuple[str, ...] = ("severity",)  # factors crossed in full
    # the n-th part of every cell is the same stamped part, so that cells are compared in pairs
    alike: bool = False
    # parts have numbers for names, drawn at random, which say nothing of their levels
    numbered: bool = False
    # levels of every factor: fields of `SynthSpec` (`pipeline.formats`), `soil`, `severity`, `light`
    part: Part
    given: tuple[str, ...] = ("format",)  # every part is read with each of these sets of facts
    sections: tuple[Section, ...] = Field(default=(), alias="section")
    fonts: dict[str, PackagedFont] = {}  # that `part.font` may name
    kept_out_soils: tuple[str, ...] = ()  # nothing in this repository may be fitted to them

    @field_validator("given")
    @classmethod
    def _check_known(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if not value:
            raise ValueError("name at least one, such as format")
        return tuple(map(parse_given, value))

    @model_validator(mode="after")
    def _agrees(self) -> Design:
        if sum(map(bool, (self.parts, self.parts_a_cell, self.sections))) != 1:
            raise ValueError("give parts, parts_a_cell or sections")
        for section in self.all_sections():
            levels = {**self.part, **section.part}
            for name, values in levels.items():
                if not values or len(set(values)) != len(values):
                    raise ValueError(f"{name} is {list(values)}: give at least one level, each once")
            if missing := [name for name in self.cross if name not in levels]:
                raise ValueError(f"cross names {', '.join(missing)}, but [part] does not")
            if missing := [name for name in ("font", "format", "severity") if name not in levels]:
                raise ValueError(f"[part] lacks {', '.join(missing)}")
            for severity in levels["severity"]:
                if isinstance(severity, str) or not 0.0 <= severity <= 1.0:
                    raise ValueError(f"a severity is {severity!r}: it lies between 0 and 1")
        if unbalanced := next(self._unbalanced(), ""):
            raise ValueError(f"it is not balanced, {unbalanced}; cross the severity, and fill every cell")
        return self

    @classmethod
    def of(cls, **values: Any) -> Design:
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            what, hint = wrong_key(error)
            raise SettingsError(f"the design {what}", hint=hint) from error

    @classmethod
    def load(cls, path: Path) -> Design:
        """Load a design. Raises FileError: no such TOML file, or no design; the message names the setting."""
        with naming(path):
            return cls.of(**{"name": path.stem, **toml_of(path)})

    def with_given(self, facts: tuple[str, ...]) -> Design:
        checked = tuple(map(parse_given, facts))
        return self.model_copy(update={"given": checked}) if checked else self

    def all_sections(self) -> tuple[Section, ...]:
        cells = math.prod(len(self.part.get(name, ())) for name in self.cross)
        return self.sections or (Section(parts=self.parts or self.parts_a_cell * max(1, cells)),)

    @property
    def font_names(self) -> tuple[str, ...]:
        named = [str(font) for s in self.all_sections() for font in {**self.part, **s.part}["font"]]
        return tuple(dict.fromkeys(named))

    @property
    def n_parts(self) -> int:
        return sum(section.parts for section in self.all_sections())

    def cells(self, section: Section) -> list[dict[str, Level]]:
        levels = {**self.part, **section.part}
        return [dict(zip(self.cross, c, strict=True)) for c in product(*(levels[f] for f in self.cross))]

    def _unbalanced(self) -> Iterator[str]:
        planned: dict[str, list[Condition]] = {}
        for section, _, _, condition in self.plan_parts():
            planned.setdefault(section.name, []).append(condition)
        for section in self.all_sections():
            levels, where = {**self.part, **section.part}, f"section {section.name}: " * bool(section.name)
            conditions = planned[section.name]
            if counts := _uneven(levels["severity"], [c["severity"] for c in conditions]):
                yield f"{where}parts by severity: {counts}"
            for severity in levels["severity"]:
                here = [c for c in conditions if c["severity"] == severity]
                for name, values in levels.items():
                    if name != "severity" and (counts := _uneven(values, [c[name] for c in here])):
                        yield f"{where}parts by {name} at severity {level_name(severity)}: {counts}"

    def plan_parts(self) -> Iterator[tuple[Section, int, int, Condition]]:
        """Yield the section, the number within it, the replicate and the levels of every part, in order."""
        for index, section in enumerate(self.all_sections()):
            levels = {**self.part, **section.part}
            cells = self.cells(section)
            others = [name for name in levels if name not in self.cross]
            rounds = math.ceil(section.parts / len(cells))
            severities = [levels["severity"].index(c["severity"]) if "severity" in c else 0 for c in cells]
            turns = {
                name: _turns(severities, rounds, len(levels[name]), seed=(self.seed, index, rank))
                for rank, name in enumerate(others)
            }
            for number in range(section.parts):
                replicate, cell = divmod(number, len(cells))
                more = {name: levels[name][turns[name][cell, replicate]] for name in others}
                chosen = {**cells[cell], **more}
                yield section, number, replicate, Condition(**{name: chosen[name] for name in levels})


def of_flags(
    levels: Mapping[str, tuple[Any, ...]], *, parts: int, seed: int, given: tuple[str, ...]
) -> Design:
    """Make a design that crosses fonts, formats, soils and severities, with the same stamped parts in every cell.
    `levels` replace the defaults of these and other factors. Raises SettingsError: an invalid one."""
    usual: dict[str, Any] = {"font": "gothic", "format": "AA999999", "soil": WORKSHOP,
             "severity": (0.0, 0.3, 0.6, 0.9), "height_mm": 5.0, "depth_mm": 0.2, "face": "flat"}  # fmt: skip
    cross, part = ("font", "format", "soil", "severity"), {**usual, **levels}
    return Design.of(seed=seed, parts_a_cell=parts, cross=cross, alike=True, part=part, given=given)


def editions() -> tuple[str, ...]:
    """Names of the editions."""
    return tuple(sorted(path.stem for path in _DESIGNS.glob("*.toml")))


def design_named(name: str) -> Design:
    """Load an edition by its name, or a design from a TOML file. Raises FileError, SettingsError: there is none."""
    if name not in editions() and not name.endswith(".toml"):
        raise SettingsError(
            f"there is no design {name!r}", hint=f"name a TOML file, or one of {', '.join(editions())}"
        )
    design = Design.load(Path(name) if name.endswith(".toml") else _DESIGNS / f"{name}.toml")
    known = toml_of(_ROOM / "fonts.toml")
    packaged = {font: PackagedFont(**known[font]) for font in design.font_names if font in known}
    return design.model_copy(update={"fonts": {**packaged, **design.fonts}})


def _uneven(levels: Sequence[Level], chosen: Sequence[Level]) -> str:
    counts = Counter(dict.fromkeys(levels, 0))
    counts.update(chosen)
    if max(counts.values()) - min(counts.values()) <= 1:
        return ""
    return ", ".join(f"{count} of {level_name(level)}" for level, count in counts.items())


def _turns(
    severities: Sequence[int], rounds: int, levels: int, *, seed: tuple[int, ...]
) -> np.ndarray[Any, Any]:
    """Draw the index of the level for each cell and round, shape (cells, rounds).

    Within each block of `levels` rounds a cell takes each level once. The cells begin evenly spaced over the levels, so
    that the counts of two levels differ by at most 1 after any number of rounds, at every severity and over all.
    """
    rng = np.random.default_rng(seed)
    cells, several = np.asarray(severities), max(severities) + 1
    out = np.empty((cells.size, rounds), dtype=np.int64)
    for block in range(0, rounds, levels):
        width = min(levels, rounds - block)
        order, first, place = rng.permutation(levels), rng.permutation(several), np.empty_like(cells)
        for severity in range(several):
            place[cells == severity] = (
                rng.permutation(int((cells == severity).sum())) * several + first[severity]
            )
        start = place * levels // cells.size
        out[:, block : block + width] = order[(start[:, None] + np.arange(width)[None, :]) % levels]
    return out
