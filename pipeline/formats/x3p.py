"""X3P (ISO 25178-72, formerly ISO 5436-2) by x3pio, with what writers get wrong.

y grows with the row, so the first row is the lowest one of the part, unless the file's `Origin` is in the north or its
increment along y is negative. Some writers put the top row first and do not say so.
"""

from __future__ import annotations

import io
import re
import tempfile
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from glyphs.errors import FileError, damage_reported, require_file
from pipeline.formats.grids import check_size
from pipeline.formats.raw_map import RawMap

MAX_FILE_BYTES = 1_000_000_000
# description (main.xml), unpacked: more than anyone writes
_MOST_DESCRIPTION_BYTES = 64_000_000
# most that X3P stores for one sample: three coordinates as float64
_MOST_BYTES_PER_SAMPLE = 24
# room for what a file holds beside its heights: a vendor's files
_MOST_SPARE_BYTES = 64_000_000
_IN_MEMORY_BYTES = 64_000_000
_MAIN, _CHECKSUM = "main.xml", "md5checksum.hex"
_ROOT = re.compile(rb"<(/?(?:\w+:)?)ISO5436(?=[\s>])")
_ORIGIN = re.compile(rb"<(?:\w+:)?Origin>\s*([NS])", re.IGNORECASE)


def read_x3p(path: Path) -> RawMap:
    """The first layer of an X3P surface, in metres.

    A description with an unusual root element, or with a checksum that it has outlived, is read all the same; the
    checksum of the heights must hold.

    Raises:
        FileError: the file cannot be used.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with damage_reported(path, kind="X3P"):
        import x3pio

        info, description = describe_x3p(path)
        if info.feature_type is not x3pio.FeatureType.SURFACE or len(info.shape) != 2:
            raise FileError(path, f"holds a {info.feature_type.name.lower()}", "export a surface on a grid")
        rows, cols = info.shape
        check_size(path, rows, cols * info.layer_count)
        if not (info.header.x.is_incremental and info.header.y.is_incremental):
            raise FileError(path, "holds points off a regular grid", "export the surface on a regular grid")
        most = max(_MOST_SPARE_BYTES, rows * cols * info.layer_count * _MOST_BYTES_PER_SAMPLE)
        with zipfile.ZipFile(path) as archive:
            _check_members(path, archive, ending="", most=most)
        try:
            surface = x3pio.read(path)
        except x3pio.X3pFormatError:  # a wrong checksum is one, too
            with tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY_BYTES) as copy:
                _mend(path, description, copy)
                surface = x3pio.read(copy)
        origin = _ORIGIN.search(description)
        downwards = info.header.y.increment < 0.0
        return RawMap(
            np.asarray(surface.layers[0].z),
            abs(info.header.x.increment),
            abs(info.header.y.increment),
            z_mm=1e3,
            xy_mm=1e3,
            bottom_first=not downwards if origin is None else origin[1] in b"sS",
            rows_stated=downwards or origin is not None,
        )


def describe_x3p(path: Path) -> tuple[Any, bytes]:
    """What x3pio says of a file by its description alone, and the description with the usual root element.

    Raises:
        x3pio.X3pFormatError: the description cannot be used.
        FileError: it is far longer than one is.
    """
    import x3pio

    with zipfile.ZipFile(path) as archive:
        _check_members(path, archive, ending=".xml", most=_MOST_DESCRIPTION_BYTES)
        names = [n for n in archive.namelist() if n.split("/")[-1] == _MAIN and "__MACOSX" not in n]
        if len(names) != 1:
            return x3pio.info(path, verify=False), b""  # x3pio says what is wrong
        description = _ROOT.sub(rb"<\1ISO5436_2", archive.read(names[0]))
    alone = io.BytesIO()
    with zipfile.ZipFile(alone, "w") as archive:
        archive.writestr(_MAIN, description)
    return x3pio.info(alone, verify=False), description


def _mend(path: Path, description: bytes, copy: IO[bytes]) -> None:
    """Copy a file with another description and without its checksum."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            last = name.split("/")[-1]
            if last == _MAIN and "__MACOSX" not in name:
                new.writestr(name, description)
            elif last and last != _CHECKSUM:
                new.writestr(name, old.read(name))
    copy.seek(0)


def _check_members(path: Path, archive: zipfile.ZipFile, *, ending: str, most: int) -> None:
    for member in archive.infolist():
        if member.filename.lower().endswith(ending) and member.file_size > most:
            size = f"{member.file_size / 1e6:,.0f} MB"
            raise FileError(path, f"unpacks to {size} ({member.filename[:50]})", "export the map alone")
