"""Height maps as instruments write them: X3P and SDF in the core, many others with the extra `formats`.

Which way is up. A HeightMap has row 0 at the top of the part as a reader sees it.

- X3P (ISO 25178-72) and SDF (ISO 25178-71) state a right-handed frame: y grows with the row, z out of the
  surface, so the first row is the *bottom* one. It is turned over here; not to do so would show the text
  mirrored. Some writers, mostly of X3P files after ISO 5436-2:2000, put the top row first all the same:
  `RowOrder.TOP_FIRST` reads those.
- SurfaceTopography hands out `heights()[x, y]` so that its transpose, seen as an image, stands upright with
  the top row first, whatever the format; except for X3P and SDF, whose rows it hands on in the file's order.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
import struct
import warnings
import zipfile
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, damage_reported, require_file
from glyphs.surface.maps import HeightMap
from pipeline.files.grids import square_map
from pipeline.files.npz import check_size

MAX_FILE_BYTES = 1_000_000_000
_MM_PER_M = 1000.0
_MAX_DESCRIPTION_BYTES = 64_000_000
_MAX_BYTES_PER_SAMPLE = 24
"""Most that X3P stores for one sample: three coordinates as float64."""
_MAX_TEXT_BYTES_PER_SAMPLE = 32
_MAX_SPARE_BYTES = 64_000_000
"""Room for what a file holds beside its heights: a trailer, a vendor's file."""
_HEAD_BYTES = 8192


class RowOrder(StrEnum):
    """In which order an X3P or SDF file holds its rows."""

    STANDARD = "standard"
    TOP_FIRST = "top-first"


def read_x3p(path: Path, *, row_order: RowOrder = RowOrder.STANDARD) -> HeightMap:
    """The first layer of an X3P surface.

    What x3pio does not take is tried with SurfaceTopography where that is installed.

    Raises:
        FileError: the file cannot be used.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    from x3pio import X3pChecksumError, X3pFormatError

    try:
        return _read_x3p(path, row_order)
    except FileError as problem:
        # a clear refusal stands, so does a wrong checksum; what could not be parsed is worth a second opinion
        cause = problem.__cause__
        unparsed = isinstance(cause, X3pFormatError) and not isinstance(cause, X3pChecksumError)
        if not unparsed or not formats_installed():
            raise
        try:
            return read_with_surface_topography(path, row_order=row_order)
        except FileError:
            raise problem from cause


def _read_x3p(path: Path, row_order: RowOrder) -> HeightMap:
    with damage_reported(path, kind="X3P"):
        import x3pio

        _check_archive(path)
        info = x3pio.info(path, verify=False)
        if info.feature_type is not x3pio.FeatureType.SURFACE or len(info.shape) != 2:
            raise FileError(path, f"holds a {info.feature_type.name.lower()}", "export a surface on a grid")
        rows, cols = info.shape
        check_size(path, rows, cols * info.layer_count)
        if not (info.header.x.is_incremental and info.header.y.is_incremental):
            raise FileError(path, "holds points off a regular grid", "export the surface on a regular grid")
        with zipfile.ZipFile(path) as archive:
            most = max(_MAX_SPARE_BYTES, rows * cols * info.layer_count * _MAX_BYTES_PER_SAMPLE)
            _check_members(path, archive, ending="", most=most)
        layer = x3pio.read(path).layers[0]
        return square_map(
            path,
            _upright(layer.z * _MM_PER_M, row_order),
            x_pitch_mm=abs(info.header.x.increment) * _MM_PER_M,
            y_pitch_mm=abs(info.header.y.increment) * _MM_PER_M,
        )


def _check_archive(path: Path) -> None:
    """Refuse an archive with more description than anyone writes."""
    with zipfile.ZipFile(path) as archive:
        _check_members(path, archive, ending=".xml", most=_MAX_DESCRIPTION_BYTES)


def _check_members(path: Path, archive: zipfile.ZipFile, *, ending: str, most: int) -> None:
    for member in archive.infolist():
        if member.filename.lower().endswith(ending) and member.file_size > most:
            size = f"{member.file_size / 1e6:,.0f} MB"
            raise FileError(path, f"unpacks to {size} ({member.filename[:50]})", "export the map alone")


def _upright(z_mm: NDArray[np.float64], row_order: RowOrder) -> NDArray[np.float64]:
    return z_mm[::-1] if row_order is RowOrder.STANDARD else z_mm


def read_sdf(path: Path, *, row_order: RowOrder = RowOrder.STANDARD) -> HeightMap:
    """An SDF surface, binary or text.

    Raises:
        FileError: the file cannot be used.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with damage_reported(path, kind="SDF"):
        import sdfio

        rows, cols = _sdf_size(path)
        check_size(path, rows, cols)
        if path.stat().st_size > rows * cols * _MAX_TEXT_BYTES_PER_SAMPLE + _MAX_SPARE_BYTES:
            raise FileError(path, f"is far longer than its {rows} x {cols} samples need", "export it again")
        surface = sdfio.read(path)
        return square_map(
            path,
            _upright(np.asarray(surface.data) * _MM_PER_M, row_order),
            x_pitch_mm=surface.header.x_scale * _MM_PER_M,
            y_pitch_mm=surface.header.y_scale * _MM_PER_M,
        )


def _sdf_size(path: Path) -> tuple[int, int]:
    """(profiles, points) as the header declares them; (0, 0) where it does not and sdfio shall complain."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES).removeprefix(b"\xef\xbb\xbf")
    if head[:1].lower() == b"b":
        counts = struct.Struct("<II" if head[1:8] == b"ISO-2.0" else "<HH")
        if len(head) < 42 + counts.size:
            return (0, 0)
        points, profiles = counts.unpack_from(head, 42)
        return (profiles, points)
    numbers = [
        re.search(rb"(?i)" + name + rb"\s*=\s*(\d{1,12})", head) for name in (b"NumProfiles", b"NumPoints")
    ]
    return (int(numbers[0][1]), int(numbers[1][1])) if numbers[0] and numbers[1] else (0, 0)


def formats_installed() -> bool:
    """Whether the extra `formats` is there."""
    from importlib.util import find_spec

    return find_spec("SurfaceTopography") is not None


def read_with_surface_topography(path: Path, *, row_order: RowOrder = RowOrder.STANDARD) -> HeightMap:
    """Any other format, through SurfaceTopography.

    Raises:
        FileError: the file cannot be used, or the extra `formats` is not installed.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    if not formats_installed():
        raise FileError(
            path,
            f"is of a format ({path.suffix or 'no suffix'}) that needs the extra `formats`",
            "install it with: pip install 'tactile-marks[formats]'",
        )
    with damage_reported(path, kind="height map"), _silence():
        from SurfaceTopography.IO import open_topography

        with open_topography(str(path)) as reader:
            channel = reader.default_channel
            _check_channel(path, channel)
            surface = reader.topography(channel_index=channel.index)
        return _from_surface_topography(path, surface, row_order)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep a parser that warns, logs or prints what it meets from doing so in the middle of a table."""
    before = logging.root.manager.disable
    nowhere = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        warnings.simplefilter("ignore")
        logging.disable(logging.CRITICAL)
        try:
            yield
        finally:
            logging.disable(before)


def _check_channel(path: Path, channel: Any) -> None:
    if channel.dim != 2:
        raise FileError(path, "holds a profile", "measure a surface")
    columns, rows = (int(n) for n in channel.nb_grid_pts)
    check_size(path, rows, columns)


def _from_surface_topography(path: Path, surface: Any, row_order: RowOrder) -> HeightMap:
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor

    if not surface.unit or surface.physical_sizes is None:
        raise FileError(path, "does not state its unit or its size", "save it as .npz with z_mm and pitch_mm")
    to_mm = get_unit_conversion_factor(surface.unit, "mm")
    heights = np.ma.filled(np.ma.asarray(surface.heights(), dtype=np.float64), np.nan)
    z_mm = np.asarray(heights.T * to_mm)
    if path.suffix.lower() in (".x3p", ".sdf"):
        z_mm = _upright(z_mm, row_order)
    columns, rows = surface.nb_grid_pts
    width, height = surface.physical_sizes
    return square_map(path, z_mm, x_pitch_mm=width / columns * to_mm, y_pitch_mm=height / rows * to_mm)
