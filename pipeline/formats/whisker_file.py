"""Whiskers and test pieces as TOML, written by `design` and used by workshops and `scan`.

format_version = 1
kind = "L"                     or "straight": l_mm instead of l1_mm, l2_mm, l3_mm
l1_mm = 35.04                  lengths in mm, angles in degrees
...
material = "music wire"        or a table with name, e_mpa, poisson, density_g_cm3, yield_mpa
[section]
kind = "ribbon"                thickness_mm, width_mm; "round": diameter_mm
[identified]                   uncertainty, for a whisker that `identify` has measured
names = ["l1_mm", ...]         sd: standard deviations; correlation: a row for each name

A test piece or golden part is a TOML file of a `Piece`, or a height map:

kind = "pits"                  or "grooves", "ball", "step"
angle_deg = [30, 45, 60]       walls; lengths in mm: depth_mm, floor_mm, width_mm, radius_mm, land_mm
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from glyphs.surface.pieces import Piece
from pipeline.common.output_paths import check_writable
from pipeline.common.parsed import Strict, read_toml, write_toml
from pipeline.errors import DataError, naming
from pipeline.formats.touch_file import read_height_map
from whisker_array.identification.bench import Unknown
from whisker_array.identification.knowledge import Knowledge
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH, usual_speed_mm_s
from whisker_array.whisker.sections import MUSIC_WIRE, Material, Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import Touch

if TYPE_CHECKING:
    from whisker_array.identification.piece_map import Heights


SUFFIX = ".toml"
# a file without a version has this one, too
FORMAT_VERSION = 1
_WRITABLE = "an L-shaped or straight whisker with a ribbon or round section throughout"

Length = Annotated[float, Field(gt=0.0, le=10_000.0, allow_inf_nan=False)]
_RASTER = ("character_height_mm", "line_pitch_mm", "sample_pitch_mm", "speed_mm_s")


@dataclass(frozen=True, eq=False)
class WhiskerFile:
    """A whisker and its use; `known`: the uncertainty of the whisker, if it was identified."""

    whisker: LShaped
    touch: Touch
    character_height_mm: float
    line_pitch_mm: float
    sample_pitch_mm: float
    speed_mm_s: float
    known: Knowledge | None = None


class _Ribbon(Strict):
    kind: Literal["ribbon"]
    thickness_mm: Length
    width_mm: Length


class _Round(Strict):
    kind: Literal["round"]
    diameter_mm: Length


_SECTIONS = {"ribbon": Rectangle, "round": Round}


class _Identified(Strict):
    names: tuple[Unknown, ...]
    sd: tuple[Annotated[float, Field(ge=0.0, allow_inf_nan=False)], ...]
    correlation: tuple[tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...], ...]

    def knowledge(self) -> Knowledge:
        sd, n = np.array(self.sd), len(self.names)
        if len(self.sd) != n or [len(row) for row in self.correlation] != [n] * n:
            what = f"identified has {n} names, but sd or correlation is not of that size"
            raise WhiskerError(what, hint="let identify --out write it again")
        return Knowledge(self.names, np.array(self.correlation).reshape(n, n) * np.outer(sd, sd))


class _Written(Strict):
    beta_deg: float = Field(default=0.0, gt=-90.0, lt=90.0)
    preload_mm: Length
    tip_radius_mm: float = Field(ge=0.0, le=1000.0, allow_inf_nan=False)
    friction: float = Field(ge=0.0, lt=2.0)
    character_height_mm: Length
    line_pitch_mm: Length | None = None
    sample_pitch_mm: Length | None = None
    speed_mm_s: Length | None = None
    material: Literal["music wire"] | Material = "music wire"
    section: _Ribbon | _Round = Field(discriminator="kind")
    identified: _Identified | None = None


class _L(_Written):
    kind: Literal["L"]
    l1_mm: Length
    l2_mm: float = Field(ge=0.0, le=10_000.0, allow_inf_nan=False)
    l3_mm: Annotated[float, Field(ge=-10_000.0, le=10_000.0, allow_inf_nan=False)] | None = None


class _Straight(_Written):
    kind: Literal["straight"]
    l_mm: Length


_OneKind = Annotated[_L | _Straight, Field(discriminator="kind")]
# with an empty kind the message on a missing one lists the valid kinds
_ANY: TypeAdapter[_L | _Straight] = TypeAdapter(
    Annotated[_OneKind, BeforeValidator(lambda keys: {"kind": "", **keys})]
)
_HIDDEN = ("L", "straight", "ribbon", "round", "Material")


def _built(written: _L | _Straight) -> WhiskerFile:
    section = _SECTIONS[written.section.kind](**written.section.model_dump(exclude={"kind"}))
    material = written.material if isinstance(written.material, Material) else MUSIC_WIRE
    shape = math.radians(written.beta_deg), section, material
    whisker = (
        straight_whisker(written.l_mm, *shape)
        if isinstance(written, _Straight)
        else LShaped(written.l1_mm, written.l2_mm, written.l3_mm, *shape)
    )
    touch = Touch.of(whisker, **written.model_dump(include={"preload_mm", "tip_radius_mm", "friction"}))
    row = touch.tip.compliance_mm_per_n[1]
    if not row[1] - touch.friction * row[0] > 0.0:
        raise DataError("describes a whisker that jams on the land", "take another setting angle")
    height = written.character_height_mm
    lines = written.line_pitch_mm or height / LINES_PER_HEIGHT
    return WhiskerFile(
        whisker=whisker,
        touch=touch,
        character_height_mm=height,
        line_pitch_mm=lines,
        sample_pitch_mm=written.sample_pitch_mm or lines / SAMPLES_PER_LINE_PITCH,
        speed_mm_s=written.speed_mm_s or usual_speed_mm_s(height),
        known=written.identified.knowledge() if written.identified is not None else None,
    )


def read_whisker_file(path: Path) -> WhiskerFile:
    """Read a whisker and its use. Raises FileError: the file is missing or invalid, or its whisker jams on the land."""
    written = read_toml(path, _ANY, format_version=FORMAT_VERSION, hidden=_HIDDEN)
    with naming(path):
        return _built(written)


def write_whisker_file(path: Path, content: WhiskerFile) -> None:
    """Write a whisker and its use, numbers in full, whole or not at all. Raises FileError: it cannot be written."""
    check_writable(path, (SUFFIX,))
    heading = f"# a whisker of tactile-marks and its use; lengths in mm\nformat_version = {FORMAT_VERSION}\n"
    with naming(path):
        write_toml(path, _written(content), heading=heading)


def _written(content: WhiskerFile) -> _L | _Straight:
    w, known = content.whisker, content.known
    kinds = [kind for kind, section in _SECTIONS.items() if isinstance(w.section, section)]
    if not kinds:
        raise DataError(f"cannot hold {w.section}", f"write {_WRITABLE}")
    lengths = {"kind": "L", "l1_mm": w.l1_mm, "l2_mm": w.l2_mm, "l3_mm": w.lowered_mm}
    identified = None
    if known is not None:
        sd = np.where(known.sd > 0.0, known.sd, 1.0)
        correlation = np.clip(known.covariance / np.outer(sd, sd), -1.0, 1.0).round(6)
        identified = {"names": known.names, "sd": tuple(known.sd), "correlation": correlation.tolist()}
    return _ANY.validate_python(
        {
            **({"kind": "straight", "l_mm": w.l1_mm} if w.is_straight else lengths),
            "beta_deg": math.degrees(w.beta_rad),
            "section": {
                "kind": kinds[0],
                **{f.name: getattr(w.section, f.name) for f in fields(w.section) if f.init},
            },
            "material": w.material.name if w.material == MUSIC_WIRE else w.material,
            "identified": identified,
            **{name: getattr(content.touch, name) for name in ("preload_mm", "tip_radius_mm", "friction")},
            **{name: getattr(content, name) for name in _RASTER},
        }
    )


# distance of samples in the map of a piece
PITCH_MM = 0.02


def read_piece(path: Path) -> Piece:
    """Read the test piece in a TOML file."""
    return read_toml(path, TypeAdapter(Piece))


def heights_of_piece(path: Path) -> Heights:
    """Height over the land at places of the piece in a file, mm. Raises FileError: no piece, or a map with holes."""
    from recognition.see.levelling import level
    from whisker_array.identification.piece_map import heights_of

    if path.suffix.lower() == SUFFIX:
        return read_piece(path).height_mm
    with naming(path):
        return heights_of(level(read_height_map(path)))
