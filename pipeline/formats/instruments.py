"""Height maps as instruments write them: SDF in the core, many others with the extra `formats`.

Which way is up. A HeightMap has row 0 at the top of the part as a reader sees it.

- SDF (ISO 25178-71), as X3P, states a right-handed frame: y grows with the row, z out of the surface, so the first
  row is the lowest one.
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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.errors import FileError, damage_reported, require_file
from pipeline.formats.grids import check_size
from pipeline.formats.raw_map import RawMap

MAX_FILE_BYTES = 1_000_000_000
_MAX_TEXT_BYTES_PER_SAMPLE = 32
# room for what a file holds beside its heights: a trailer
_MAX_SPARE_BYTES = 64_000_000
_HEAD_BYTES = 8192
_NO_HEIGHTS = re.compile(
    r"intens|light|laser|image|colou?r|amplitude|phase|error|deflection|quality", re.IGNORECASE
)
_OTHER_UNIT = re.compile(r"Unknown unit '(.*)'\.?|.* while unit '(.*)' is of kind .*")


def read_sdf(path: Path) -> RawMap:
    """An SDF surface, binary or text, in metres.

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
        return RawMap(
            np.asarray(surface.data),
            surface.header.x_scale,
            surface.header.y_scale,
            z_mm=1e3,
            xy_mm=1e3,
            bottom_first=True,
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


def read_with_surface_topography(path: Path, *, known: bool = True) -> RawMap:
    """Any other format, through SurfaceTopography.

    Args:
        path: the file.
        known: its suffix is that of a format that SurfaceTopography reads.

    Raises:
        FileError: the file cannot be used, or the extra `formats` is not installed.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with path.open("rb") as stream:
        if stream.read(12) == b"DSCOMPRESSED":
            raise FileError(path, "is compressed", "save it uncompressed, or export it as X3P")
    if not formats_installed():
        raise FileError(
            path,
            f"is of a format ({path.suffix or 'no suffix'}) that needs the extra `formats`",
            "install it with: pip install 'tactile-marks[formats]'",
        )
    with damage_reported(path, kind=path.suffix if known else "height map"), _silence():
        from SurfaceTopography.Exceptions import CannotDetectFileFormat
        from SurfaceTopography.IO import open_topography

        try:
            with open_topography(str(path)) as reader:
                getattr(
                    reader, "_masks", {}
                ).clear()  # of Gwyddion: what the user has selected, no missing data
                channel = _height_channel(path, reader)
                surface = reader.topography(channel_index=channel.index)
                return _raw_map(path, surface)
        except CannotDetectFileFormat as error:
            if known:
                raise FileError(
                    path, f"is damaged or no {path.suffix} file", "copy or export it again"
                ) from error
            raise _unread(path) from error
        except ValueError as error:
            if found := _OTHER_UNIT.fullmatch(str(error)):
                unit = (found[1] or found[2] or "").strip()
                what = (
                    f"an image (z in {unit!r}), no heights" if unit else "no heights: z has no unit of length"
                )
                raise FileError(path, f"holds {what}", "export the channel of heights") from error
            raise


def _unread(path: Path) -> FileError:
    return FileError(
        path,
        "is of no format that is read as heights (.npz, .npy, .x3p, .sdf, .sur, .opd, .stl, .ply, .obj, .pcd, and "
        "text: x y z columns or a matrix)",
        "export it as X3P, PLY or columns x y z, or save .npz with z_mm and pitch_mm",
    )


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


def _height_channel(path: Path, reader: Any) -> Any:
    """The first channel of heights, the file's default before others."""
    channels = list(reader.channels)
    default = channels[reader.default_channel.index] if channels else None
    for channel in sorted(channels, key=lambda c: c is not default):
        kind = getattr(getattr(channel, "data_kind", None), "value", "height")
        if kind == "height" and not _NO_HEIGHTS.search(str(channel.name or "")):
            break
    else:
        names = ", ".join(str(c.name) for c in channels) or "none is a length"
        raise FileError(
            path, f"holds no heights; its channels are images ({names})", "export the channel of heights"
        )
    if channel.dim != 2:
        raise FileError(path, "holds a profile", "measure a surface")
    columns, rows = (int(n) for n in channel.nb_grid_pts)
    check_size(path, rows, columns)
    return channel


def _raw_map(path: Path, surface: Any) -> RawMap:
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor

    if not surface.unit or surface.physical_sizes is None:
        raise FileError(path, "does not state its unit or its size", "save it as .npz with z_mm and pitch_mm")
    # X3P and SDF are met with either row first
    either = path.suffix.lower() in (".x3p", ".sdf")
    to_mm = float(get_unit_conversion_factor(surface.unit, "mm"))
    heights = np.ma.filled(np.ma.asarray(surface.heights(), dtype=np.float64), np.nan)
    columns, rows = surface.nb_grid_pts
    width, height = surface.physical_sizes
    return RawMap(
        np.asarray(heights.T),
        float(width / columns),
        float(height / rows),
        z_mm=to_mm,
        xy_mm=to_mm,
        bottom_first=either,
        rows_stated=not either,
    )
