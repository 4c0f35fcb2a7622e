"""The glyph database: fonts and enrolled exemplars in one file.

name of the format, format_version, sha256       a line each
the database as JSON, compressed by zlib         an array is {"dtype", "shape", "base64"}

The digest covers everything after it and is checked before anything is unpacked. The unpacked size is limited.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import to_json

from glyphs.atomic import replacing
from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font
from glyphs.surface.display import OneLine
from pipeline.common.parsed import wrong_key
from pipeline.errors import DataError, reading

FORMAT_NAME = "tactile-marks glyph database"
FORMAT_VERSION = 3
MOST_FILE_BYTES = 1_000_000_000
MOST_FONTS = 200
# of one character: the work of drawing it grows with their square
MOST_GLYPH_POINTS = 5_000
# unpacked size that is always allowed, and as a multiple of the file's length; exemplars pack to half
_LEAST_UNPACKED_BYTES, _MOST_RATIO = 64_000_000, 20
_NUMBERS = ("<f4", "<f8")


@dataclass(frozen=True, eq=False, repr=False)
class Exemplar(OneLine):
    """One character measured by touch, and enrolled. Raises MarksError: not one character, no time, or no relief."""

    char: str
    font_name: str
    # (rows, cols) height over the land in character heights, negative in the mark, along the line; NaN where unknown
    relief: NDArray[np.float32]
    note: str  # remark of the person who enrolled it
    enrolled_at: str  # ISO 8601
    height_mm: float = 0.0
    rotation_deg: float = 0.0  # of its line in the plate frame
    raised: bool = False
    part: str = ""
    place: int = 0  # of the character in the part's text, from 1; 0 where unknown
    evidence: str = ""  # SHA-256 of the file it was cut from, hexadecimal; the same file is enrolled once

    def __post_init__(self) -> None:
        if np.ndim(self.relief) != 2:
            raise MarksError(f"a relief of {np.shape(self.relief)} has no rows and columns")
        if len(self.char) != 1:
            raise MarksError(f"an exemplar stands for one character, not for {self.char!r}")
        try:
            datetime.fromisoformat(self.enrolled_at)
        except ValueError:
            raise MarksError(
                f"enrolled_at is {self.enrolled_at!r}",
                hint="give an ISO 8601 time, 2024-05-17T09:30:00+00:00 for example",
            ) from None


@dataclass(frozen=True, eq=False, repr=False)
class GlyphDatabase(OneLine):
    """Fonts by name (read-only) and exemplars in order of enrolment. Raises MarksError: a font's name differs."""

    fonts: Mapping[str, Font] = field(default_factory=dict)
    exemplars: tuple[Exemplar, ...] = ()
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(arbitrary_types_allowed=True, extra="forbid")

    def __post_init__(self) -> None:
        for name, font in self.fonts.items():
            if name != font.name:
                raise MarksError(
                    f"font {font.name!r} is filed under {name!r}", hint="file it under its own name"
                )
        object.__setattr__(self, "fonts", MappingProxyType(dict(self.fonts)))
        object.__setattr__(self, "exemplars", tuple(self.exemplars))


def save_database(database: GlyphDatabase, path: str | Path) -> None:
    """Write the database, whole or not at all. Raises FileError: the place cannot be written."""
    body = zlib.compress(to_json(database, fallback=_plain))
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(_head(body) + body)


def load_database(path: str | Path) -> GlyphDatabase:
    """Read a database. Raises FileError: it is missing, damaged, of another kind, or newer than this program."""
    with reading(Path(path), most_bytes=MOST_FILE_BYTES, kind="glyph database"):
        return _unpack(_checked_body(Path(path).read_bytes()))


def _head(body: bytes) -> bytes:
    digest = hashlib.sha256(body).hexdigest()
    return f"{FORMAT_NAME}\nformat_version {FORMAT_VERSION}\nsha256 {digest}\n".encode("ascii")


def _checked_body(data: bytes) -> bytes:
    name, _, after_name = data.partition(b"\n")
    if name != FORMAT_NAME.encode("ascii"):
        raise DataError("is not a glyph database, or its first bytes are damaged", "restore it from a copy")
    version = after_name.partition(b"\n")[0].removeprefix(b"format_version ")
    if version.isdigit() and len(version) < 6 and int(version) > FORMAT_VERSION:
        what = f"has format version {int(version)}, newer than {FORMAT_VERSION}"
        raise DataError(what, "update this program to read it")
    body = data[len(_head(b"")) :]
    if not data.startswith(_head(body)):
        raise DataError("is damaged or cut short (its digest does not match)", "restore it from a copy")
    return body


# its digest matches: any fault in it comes from the program that wrote it
def _unpack(body: bytes) -> GlyphDatabase:
    most, unpacking = max(_LEAST_UNPACKED_BYTES, _MOST_RATIO * len(body)), zlib.decompressobj()
    text = unpacking.decompress(body, most)
    if unpacking.unconsumed_tail:
        raise DataError(f"unpacks to more than {most / 1e6:,.0f} MB", "write it again with save_database")
    try:
        database: GlyphDatabase = TypeAdapter(GlyphDatabase).validate_python(
            json.loads(text, object_hook=_array)
        )
    except Exception as error:
        reason = wrong_key(error)[0] if isinstance(error, ValidationError) else getattr(error, "what", error)
        raise DataError(f"is not a glyph database ({reason})", "write it again with save_database") from error
    if len(database.fonts) > MOST_FONTS:
        raise DataError(f"holds {len(database.fonts)} fonts, over the limit of {MOST_FONTS}", "split it")
    for font in database.fonts.values():
        for glyph in font.glyphs.values():
            if sum(map(len, glyph.strokes + glyph.contours)) > MOST_GLYPH_POINTS:
                what = f"draws {glyph.char!r} with more than {MOST_GLYPH_POINTS:,} points"
                raise DataError(what, "simplify the font")
    return database


def _plain(value: Any) -> dict[str, Any]:
    if not isinstance(value, np.ndarray):
        return dict(value)
    numbers = base64.b64encode(value.tobytes()).decode("ascii")
    return {"dtype": value.dtype.str, "shape": value.shape, "base64": numbers}


def _array(written: dict[str, Any]) -> Any:
    if written.keys() != {"dtype", "shape", "base64"} or written["dtype"] not in _NUMBERS:
        return written
    return np.frombuffer(base64.b64decode(written["base64"]), written["dtype"]).reshape(written["shape"])
