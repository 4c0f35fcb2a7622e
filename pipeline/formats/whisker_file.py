"""A whisker and its use as TOML: what `design` writes, a workshop builds and `scan` feels with.

format_version = 1
kind = "L"                     or "straight": l_mm instead of l1_mm, l2_mm, l3_mm
l1_mm = 35.04                  lengths in mm, angles in degrees
...
material = "music wire"        or a table with name, e_mpa, poisson, density_g_cm3, yield_mpa
[section]
kind = "ribbon"                thickness_mm, width_mm; "round": diameter_mm
[identified]                   of a whisker that `identify` has found: how well
names = ["l1_mm", ...]         sd: standard deviations; correlation: a row for each name
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from glyphs.atomic import check_writable, replacing
from glyphs.errors import FileError
from pipeline.formats.toml_file import toml_table, wrong_key
from whisker_array.identification.bench import Unknown
from whisker_array.identification.promises import Knowledge
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAFE_SPEED_MM_S, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.sections import MUSIC_WIRE, Material, Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import Touch

FORMAT_VERSION = 1
"""Of a file that tells none, too: it was the first."""
_WRITABLE = "an L-shaped or straight whisker with a ribbon or round section throughout"

Length = Annotated[float, Field(gt=0.0, le=10_000.0, allow_inf_nan=False)]
_MATERIALS = {"music wire": MUSIC_WIRE}


@dataclass(frozen=True, eq=False)
class WhiskerFile:
    """A whisker and its use.

    Attributes:
        whisker: the whisker.
        touch: how it meets the surface.
        character_height_mm: the characters it is for.
        line_pitch_mm: distance of traced lines.
        sample_pitch_mm: distance of samples.
        speed_mm_s: scan speed.
        known: how well the whisker is known, where it was identified.
    """

    whisker: LShaped
    touch: Touch
    character_height_mm: float
    line_pitch_mm: float
    sample_pitch_mm: float
    speed_mm_s: float
    known: Knowledge | None = None


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Ribbon(_Strict):
    kind: Literal["ribbon"]
    thickness_mm: Length
    width_mm: Length


class _Wire(_Strict):
    kind: Literal["round"]
    diameter_mm: Length


class _Material(_Strict):
    name: str = Field(min_length=1)
    e_mpa: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    poisson: float = Field(ge=0.0, lt=0.5)
    density_g_cm3: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    yield_mpa: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class _Identified(_Strict):
    names: tuple[Unknown, ...]
    sd: tuple[Annotated[float, Field(ge=0.0, allow_inf_nan=False)], ...]
    correlation: tuple[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], ...]

    def knowledge(self) -> Knowledge:
        """How well the whisker is known."""
        sd, n = np.array(self.sd), len(self.names)
        if len(self.sd) != n or [len(row) for row in self.correlation] != [n] * n:
            raise WhiskerError(
                f"identified has {n} names, and not as many of sd and of each side of correlation",
                hint="let identify --out write it anew",
            )
        return Knowledge(self.names, np.array(self.correlation).reshape(n, n) * np.outer(sd, sd))


class _Use(_Strict):
    beta_deg: float = Field(default=0.0, gt=-90.0, lt=90.0)
    section: _Ribbon | _Wire = Field(discriminator="kind")
    material: Literal["music wire"] | _Material = "music wire"
    preload_mm: Length
    tip_radius_mm: float = Field(ge=0.0, le=1000.0, allow_inf_nan=False)
    friction: float = Field(ge=0.0, lt=2.0)
    character_height_mm: Length
    line_pitch_mm: Length | None = None
    sample_pitch_mm: Length | None = None
    speed_mm_s: Length | None = None
    identified: _Identified | None = None

    def _section(self) -> Rectangle | Round:
        if isinstance(self.section, _Ribbon):
            return Rectangle(self.section.thickness_mm, self.section.width_mm)
        return Round(self.section.diameter_mm)

    def _made_of(self) -> Material:
        if isinstance(self.material, str):
            return _MATERIALS[self.material]
        return Material(**self.material.model_dump())

    def shape(self) -> LShaped:
        """The whisker of this kind."""
        raise NotImplementedError

    def build(self) -> WhiskerFile:
        """Whisker, touch and raster, with defaults scaled to the character height."""
        whisker, height = self.shape(), self.character_height_mm
        lines = self.line_pitch_mm or height / LINES_PER_HEIGHT
        return WhiskerFile(
            whisker=whisker,
            touch=Touch(
                tip=whisker.tip_model(),
                preload_mm=self.preload_mm,
                tip_radius_mm=self.tip_radius_mm,
                friction=self.friction,
                whisker=whisker.describe(),
            ),
            character_height_mm=height,
            line_pitch_mm=lines,
            sample_pitch_mm=self.sample_pitch_mm or lines / SAMPLES_PER_LINE_PITCH,
            speed_mm_s=self.speed_mm_s or min(10.0 * height, SAFE_SPEED_MM_S),
            known=self.identified.knowledge() if self.identified is not None else None,
        )


class _L(_Use):
    kind: Literal["L"]
    l1_mm: Length
    l2_mm: float = Field(ge=0.0, le=10_000.0, allow_inf_nan=False)
    l3_mm: Annotated[float, Field(ge=-10_000.0, le=10_000.0, allow_inf_nan=False)] | None = None

    def shape(self) -> LShaped:
        """The L; l3 = l2 unless given."""
        return LShaped(
            self.l1_mm, self.l2_mm, self.l3_mm, math.radians(self.beta_deg), self._section(), self._made_of()
        )


class _Straight(_Use):
    kind: Literal["straight"]
    l_mm: Length

    def shape(self) -> LShaped:
        """The straight one."""
        return straight_whisker(self.l_mm, math.radians(self.beta_deg), self._section(), self._made_of())


_KINDS: dict[str, type[_Use]] = {"L": _L, "straight": _Straight}


def read_whisker_file(path: Path) -> WhiskerFile:
    """Read a whisker and its use.

    Raises:
        FileError: no file, no TOML, unknown or missing keys, numbers that cannot be, a whisker that jams on
            the land.
    """
    written = toml_table(path, format_version=FORMAT_VERSION)
    kind = written.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        says = "has no kind" if kind is None else f"has the kind {kind!r}"
        raise FileError(path, says, f"write kind = one of {', '.join(map(repr, _KINDS))}")
    try:
        built = _KINDS[kind].model_validate(written).build()
    except ValidationError as error:
        raise FileError(path, *wrong_key(error, hidden=("ribbon", "round", "_Material"))) from error
    except WhiskerError as error:
        raise FileError(path, f"does not describe a whisker: {error.what}", error.hint) from error
    row, mu = built.touch.tip.compliance_mm_per_n[1], built.touch.friction
    if not row[1] - mu * row[0] > 0.0:
        raise FileError(path, "describes a whisker that jams on the land", "take another setting angle")
    return built


def write_whisker_file(path: Path, content: WhiskerFile) -> None:
    """Write a whisker and its use; the file appears whole or not at all.

    Numbers are written in full, so that reading gives the same whisker again (angles to rounding).

    Raises:
        FileError: not a .toml, it cannot be written, or the whisker is of a kind that this file cannot hold.
    """
    check_whisker_file(path)
    text = "\n".join(_lines(path, content)) + "\n"
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_whisker_file(path: Path) -> None:
    """Refuse, before the work starts, a file that could not be written at its end.

    Raises:
        FileError: another suffix, or a place that cannot be written.
    """
    if path.suffix.lower() != ".toml":
        raise FileError(path, "is not a whisker file", "end it in .toml")
    check_writable(path)


def _lines(path: Path, content: WhiskerFile) -> list[str]:
    w, touch = content.whisker, content.touch
    shape: dict[str, str | float] = (
        {"kind": "straight", "l_mm": w.l1_mm}
        if w.is_straight
        else {"kind": "L", "l1_mm": w.l1_mm, "l2_mm": w.l2_mm, "l3_mm": w.lowered_mm}
    )
    shape["beta_deg"] = math.degrees(w.beta_rad)
    use: dict[str, str | float] = {
        "preload_mm": touch.preload_mm,
        "tip_radius_mm": touch.tip_radius_mm,
        "friction": touch.friction,
        "character_height_mm": content.character_height_mm,
        "line_pitch_mm": content.line_pitch_mm,
        "sample_pitch_mm": content.sample_pitch_mm,
        "speed_mm_s": content.speed_mm_s,
    }
    section: dict[str, str | float]
    if isinstance(w.section, Rectangle):
        section = {"kind": "ribbon", "thickness_mm": w.section.thickness_mm, "width_mm": w.section.width_mm}
    elif isinstance(w.section, Round):
        section = {"kind": "round", "diameter_mm": w.section.diameter_mm}
    else:
        raise FileError(path, f"cannot hold {w.section}", f"write {_WRITABLE}")
    version = f"format_version = {FORMAT_VERSION}"
    lines = ["# a whisker of tactile-marks and its use; lengths in mm", version, *_pairs(shape | use)]
    m = w.material
    if _MATERIALS.get(m.name) == m:
        lines += _pairs({"material": m.name})
    else:
        constants = ("e_mpa", "poisson", "density_g_cm3", "yield_mpa")
        lines += ["[material]", *_pairs({"name": m.name} | {key: getattr(m, key) for key in constants})]
    return [*lines, "[section]", *_pairs(section), *_known(content.known)]


def _known(known: Knowledge | None) -> list[str]:
    if known is None:
        return []
    sd = np.where(known.sd > 0.0, known.sd, 1.0)
    correlation = np.clip(known.covariance / np.outer(sd, sd), -1.0, 1.0)
    rows = (f"[{', '.join(f'{value:.6g}' for value in row)}]" for row in correlation)
    return [
        "[identified]",
        f"names = [{', '.join(_written(name.value) for name in known.names)}]",
        f"sd = [{', '.join(_written(float(value)) for value in known.sd)}]",
        f"correlation = [{', '.join(rows)}]",
    ]


def _pairs(table: dict[str, str | float]) -> list[str]:
    return [f"{key} = {_written(value)}" for key, value in table.items()]


def _written(value: str | float) -> str:
    if isinstance(value, str):
        # a JSON string is a TOML string, but for DEL, which TOML wants escaped
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))
