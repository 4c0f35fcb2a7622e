"""The glyph database: fonts and enrolled exemplars in one file.

The file is HDF5 behind a user block of 512 bytes that names the format, its version and the SHA-256 of all
that follows. The digest is checked before the HDF5 library sees a byte: a damaged file is refused, never
half-read. Any HDF5 reader opens it, since HDF5 skips user blocks.

A file can come from anybody, so its size, links and storage are checked before its data are read.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.errors import FileError, MarksError
from glyphs.fonts.glyph import Font, Glyph
from glyphs.surface.display import OneLine
from pipeline.errors import require_file
from pipeline.formats.hdf5_checks import n_bytes, n_values, own_datasets

FORMAT_NAME = "tactile-marks glyph database"
FORMAT_VERSION = 2
_BLOCK_BYTES = 512
MOST_FILE_BYTES = 1_000_000_000
MOST_OBJECTS = 20_000
"""Groups and datasets; an exemplar has four, a font eight."""
MOST_FONTS, MOST_LINES = 200, 500_000
MOST_GLYPH_POINTS = 5_000
"""Most points of one character: the work of drawing it grows with their square."""
_LEAST_UNPACKED_BYTES, _MOST_RATIO = 64_000_000, 100
"""Data may always unpack to so much, beyond that to so many times the file's length; exemplars pack tenfold at most."""
_FONT_ATTRIBUTES = ("name", "source", "stroke_ratio")
_EXEMPLAR_TEXTS = ("char", "font_name", "note", "enrolled_at", "part", "evidence")
_EXEMPLAR_NUMBERS = ("height_mm", "rotation_deg", "raised")


class DatabaseError(MarksError):
    """A database that cannot be read, written or made."""


@dataclass(frozen=True, eq=False, repr=False)
class Exemplar(OneLine):
    """One character as it was once felt, enrolled by hand.

    Attributes:
        char: what it is, one character.
        font_name: the font it was stamped with, may be empty if unknown.
        relief: (rows, cols) float32 height over the land in character heights, negative in the mark, along the line;
            NaN where not known.
        note: anything the enroller wants to say.
        enrolled_at: ISO 8601 time, given by the caller.
        height_mm: character height; 0 where unknown.
        rotation_deg: of its line in the plate frame.
        raised: whether the mark stands out.
        part: name of the part.
        evidence: SHA-256 of the file it was cut from, hexadecimal; the same file is enrolled once.

    Raises:
        DatabaseError: not one character, a time that is not ISO 8601, or a relief without rows and columns.
    """

    char: str
    font_name: str
    relief: NDArray[np.float32]
    note: str
    enrolled_at: str
    height_mm: float = 0.0
    rotation_deg: float = 0.0
    raised: bool = False
    part: str = ""
    evidence: str = ""

    def __post_init__(self) -> None:
        if np.ndim(self.relief) != 2:
            raise DatabaseError(f"a relief of {np.shape(self.relief)} has no rows and columns")
        if len(self.char) != 1:
            raise DatabaseError(f"an exemplar stands for one character, not for {self.char!r}")
        try:
            datetime.fromisoformat(self.enrolled_at)
        except ValueError:
            raise DatabaseError(
                f"enrolled_at is {self.enrolled_at!r}",
                hint="give an ISO 8601 time, 2024-05-17T09:30:00+00:00 for example",
            ) from None


@dataclass(frozen=True, eq=False, repr=False)
class GlyphDatabase(OneLine):
    """Fonts and enrolled exemplars of the letters in use.

    Attributes:
        fonts: by name, read-only.
        exemplars: in order of enrolment.

    Raises:
        DatabaseError: a font filed under another name.
    """

    fonts: Mapping[str, Font] = field(default_factory=dict)
    exemplars: tuple[Exemplar, ...] = ()

    def __post_init__(self) -> None:
        for name, font in self.fonts.items():
            if name != font.name:
                raise DatabaseError(
                    f"font {font.name!r} is filed under {name!r}", hint="file it under its own name"
                )
        object.__setattr__(self, "fonts", MappingProxyType(dict(self.fonts)))
        object.__setattr__(self, "exemplars", tuple(self.exemplars))


def save_database(database: GlyphDatabase, path: str | Path) -> None:
    """Write the database, whole or not at all: a reader sees the old file or the new one.

    Raises:
        DatabaseError: the folder is missing or not writable, or the disk is full.
    """
    body = _pack(database)
    try:
        with replacing(Path(path)) as temporary:
            temporary.write_bytes(_block(body) + body)
    except FileError as error:
        raise DatabaseError(f"{str(path)!r} {error.what}", hint=error.hint) from error


def load_database(path: str | Path) -> GlyphDatabase:
    """Read a database written by `save_database`.

    Raises:
        DatabaseError: the file is missing, damaged, cut short, of another kind, or newer than this program.
    """
    try:
        require_file(Path(path), most_bytes=MOST_FILE_BYTES)
        return _unpack(_checked_body(Path(path).read_bytes()))
    except MarksError as error:
        raise DatabaseError(f"{str(path)!r} {error.what}", hint=error.hint) from error
    except OSError as error:
        what = f"{str(path)!r} cannot be read ({error.strerror or error})"
        raise DatabaseError(what, hint="check its permissions") from error


def _block(body: bytes) -> bytes:
    """The user block in front of an HDF5 body."""
    text = f"{FORMAT_NAME}\nformat_version {FORMAT_VERSION}\nsha256 {hashlib.sha256(body).hexdigest()}\n"
    return text.encode("ascii").ljust(_BLOCK_BYTES, b"\0")


def _checked_body(data: bytes) -> bytes:
    """The HDF5 bytes behind the user block, once name, version and digest have proved right."""
    head, body = data[:_BLOCK_BYTES], data[_BLOCK_BYTES:]
    name, _, rest = head.partition(b"\n")
    if name != FORMAT_NAME.encode("ascii"):
        raise DatabaseError(
            "is not a glyph database, or its first bytes are damaged", hint="restore it from a copy"
        )
    version = rest.partition(b"\n")[0].removeprefix(b"format_version ")
    if version.isdigit() and len(version) < 6 and int(version) > FORMAT_VERSION:
        raise DatabaseError(
            f"has format version {int(version)}, newer than {FORMAT_VERSION}",
            hint="update this program to read it",
        )
    if head != _block(body):
        raise DatabaseError(
            "is damaged or cut short (its digest does not fit)", hint="restore it from a copy"
        )
    return body


def _pack(database: GlyphDatabase) -> bytes:
    """The database as the bytes of an HDF5 file."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["format"] = FORMAT_NAME
        file.attrs["format_version"] = FORMAT_VERSION
        fonts = file.create_group("fonts")
        for k, font in enumerate(database.fonts.values()):
            _pack_font(fonts.create_group(str(k)), font)
        exemplars = file.create_group("exemplars")
        for k, exemplar in enumerate(database.exemplars):
            _pack_exemplar(exemplars.create_group(str(k)), exemplar)
    return buffer.getvalue()


def _unpack(body: bytes) -> GlyphDatabase:
    """The database from the bytes of an HDF5 file.

    Raises:
        DatabaseError: whatever is wrong with it: the digest fits, so another program wrote nonsense.
    """
    import h5py

    def in_order(group: Any) -> list[Any]:
        return [group[key] for key in sorted(group, key=int)]

    try:
        with h5py.File(io.BytesIO(body), "r") as file:
            _check_content(file, len(body))
            fonts = {font.name: font for font in map(_unpack_font, in_order(file["fonts"]))}
            return GlyphDatabase(fonts, tuple(map(_unpack_exemplar, in_order(file["exemplars"]))))
    except Exception as error:
        reason = error.what if isinstance(error, MarksError) else error
        raise DatabaseError(
            f"is not a glyph database ({reason})", hint="write it again with save_database"
        ) from error


def _check_content(file: Any, length: int) -> None:
    """Refuse what unpacks to far more than the file's length, lies elsewhere, or is too much to work with."""
    most = max(_LEAST_UNPACKED_BYTES, _MOST_RATIO * length)
    unpacked = 0
    for dataset in own_datasets(file, most_objects=MOST_OBJECTS, names_once=True):
        unpacked += n_bytes(dataset)
        if unpacked > most:
            raise DatabaseError(f"unpacks to more than {most / 1e6:,.0f} MB")
    fonts = file["fonts"]
    if len(fonts) > MOST_FONTS:
        raise DatabaseError(f"holds {len(fonts)} fonts, over the limit of {MOST_FONTS}")
    lines = sum(n_values(font["line_points"]) for font in fonts.values())
    if lines > MOST_LINES:
        raise DatabaseError(f"draws {lines:,} lines, over the limit of {MOST_LINES:,}")


def _pack_font(group: Any, font: Font) -> None:
    """All points of a font in one dataset, with the length and owner of each line beside it."""
    for key in _FONT_ATTRIBUTES:
        group.attrs[key] = getattr(font, key)
    glyphs = list(font.glyphs.values())
    lines = [(k, line) for k, glyph in enumerate(glyphs) for line in glyph.strokes + glyph.contours]
    group["characters"] = np.array([ord(g.char) for g in glyphs], dtype=np.uint32)
    for key in ("advance", "stroke"):
        group[key] = np.array([getattr(g, key) for g in glyphs], dtype=np.float64)
    group["outlined"] = np.array([bool(g.contours) for g in glyphs], dtype=np.uint8)
    group["line_glyph"] = np.array([k for k, _ in lines], dtype=np.uint32)
    group["line_points"] = np.array([len(line) for _, line in lines], dtype=np.uint32)
    group["points"] = np.concatenate([line for _, line in lines] or [np.empty((0, 2))])
    if font.learned:
        group["guessed"] = np.array([g.guessed for g in glyphs], dtype=np.uint8)
        for k, glyph in enumerate(glyphs):
            if glyph.relief is not None:
                _pack_layer(group, f"felt/{k}", glyph.relief)


def _unpack_font(group: Any) -> Font:
    keys = "characters", "outlined", "advance", "stroke", "line_glyph", "line_points", "points"
    codes, outlined, advance, stroke, owner, lengths, points = (_numbers(group, key) for key in keys)
    guessed = _numbers(group, "guessed") if "guessed" in group else np.zeros(codes.size)
    felt = group.get("felt", {})
    lines: list[list[NDArray[np.float64]]] = [[] for _ in codes]
    for k, line in zip(owner, np.split(points, np.cumsum(lengths)[:-1]) if lengths.size else (), strict=True):
        lines[int(k)].append(line)
    glyphs = {}
    for k, char in enumerate(chr(int(code)) for code in codes):
        if sum(map(len, lines[k])) > MOST_GLYPH_POINTS:
            raise DatabaseError(
                f"draws {char!r} with more than {MOST_GLYPH_POINTS:,} points", hint="simplify the font"
            )
        glyphs[char] = Glyph(
            char,
            **{"contours" if outlined[k] else "strokes": tuple(lines[k])},
            advance=float(advance[k]),
            stroke=float(stroke[k]),
            relief=_numbers(felt, str(k)) if str(k) in felt else None,
            guessed=bool(guessed[k]),
        )
    name, source, ratio = (group.attrs[key] for key in _FONT_ATTRIBUTES)
    return Font(str(name), glyphs, float(ratio), str(source))


def _pack_exemplar(group: Any, exemplar: Exemplar) -> None:
    for key in _EXEMPLAR_TEXTS + _EXEMPLAR_NUMBERS:
        group.attrs[key] = getattr(exemplar, key)
    _pack_layer(group, "relief", exemplar.relief)


def _pack_layer(group: Any, key: str, values: NDArray[Any]) -> None:
    group.create_dataset(key, data=values, compression="gzip", compression_opts=4, shuffle=True)


def _unpack_exemplar(group: Any) -> Exemplar:
    texts: dict[str, Any] = {key: str(group.attrs[key]) for key in _EXEMPLAR_TEXTS}
    numbers: dict[str, Any] = {key: group.attrs[key].item() for key in _EXEMPLAR_NUMBERS}
    return Exemplar(relief=_numbers(group, "relief"), **texts, **numbers)


def _numbers(group: Any, key: str) -> Any:
    """A dataset as an array; anything but plain numbers is refused."""
    dataset = group[key]
    if dataset.dtype.kind not in "fiub":
        raise DatabaseError(
            f"{group.name}/{key} is of type {dataset.dtype}", hint="only plain numbers are read"
        )
    return dataset[()]
