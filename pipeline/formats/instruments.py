"""Height maps as instruments write them, with the extra `formats`.

SurfaceTopography hands out `heights()[x, y]` so that its transpose, seen as an image, stands upright with the top row
first, whatever the format; except for X3P and SDF, whose rows it hands on in the file's order.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.kinds import FORMATS_SUFFIXES
from pipeline.formats.raw_map import RawMap, check_size
from pipeline.formats.touch_file import check_hdf5

_NO_HEIGHTS = re.compile(
    r"intens|light|laser|image|colou?r|amplitude|phase|error|deflection|quality", re.IGNORECASE
)
_NO_FORMAT = (
    "is of no format that is read as heights (.npz, .npy, .x3p, .sdf, .sur, .opd, .stl, .ply, .obj, .pcd, and text: "
    "x y z columns or a matrix)"
)
_EXPORT = "export it as X3P, PLY or columns x y z, or save .npz with z_mm and pitch_mm"
_OTHER_UNIT = re.compile(r"Unknown unit '(.*)'\.?|.* while unit '(.*)' is of kind .*")


def formats_installed() -> bool:
    """Whether the extra `formats` is there."""
    from importlib.util import find_spec

    return find_spec("SurfaceTopography") is not None


def read_instrument(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of a file, through SurfaceTopography.

    Args:
        path: the file.
        most: samples that it may hold.

    Raises:
        DataError: the file cannot be used, or the extra `formats` is not installed.
    """
    with path.open("rb") as stream:
        if stream.read(12) == b"DSCOMPRESSED":
            raise DataError("is compressed", "save it uncompressed, or export it as X3P")
    if not formats_installed():
        what = f"is of a format ({path.suffix or 'no suffix'}) that needs the extra `formats`"
        raise DataError(what, "install it with: pip install 'tactile-marks[formats]'")
    import h5py

    if h5py.is_hdf5(path):
        check_hdf5(path, most=most)
    with _silence():
        from SurfaceTopography.Exceptions import CannotDetectFileFormat
        from SurfaceTopography.IO import open_topography

        try:
            with open_topography(str(path)) as reader:
                # of Gwyddion: what the user has selected, no missing data
                getattr(reader, "_masks", {}).clear()
                channel = _height_channel(reader, most)
                surface = reader.topography(channel_index=channel.index)
                # X3P and SDF are met with either row first
                return _raw_map(surface, rows_stated=path.suffix.lower() not in (".x3p", ".sdf"))
        except CannotDetectFileFormat as error:
            if path.suffix.lower() in FORMATS_SUFFIXES:
                raise DataError(f"is damaged or no {path.suffix} file", "copy or export it again") from error
            raise DataError(_NO_FORMAT, _EXPORT) from error
        except ValueError as error:
            if not (found := _OTHER_UNIT.fullmatch(str(error))):
                raise
            unit = (found[1] or found[2] or "").strip()
            what = f"an image (z in {unit!r}), no heights" if unit else "no heights: z has no unit of length"
            raise DataError(f"holds {what}", "export the channel of heights") from error


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


def _height_channel(reader: Any, most: int) -> Any:
    """The first channel of heights, the file's default before others."""
    channels = list(reader.channels)
    default = channels[reader.default_channel.index] if channels else None
    for channel in sorted(channels, key=lambda c: c is not default):
        kind = getattr(getattr(channel, "data_kind", None), "value", "height")
        if kind == "height" and not _NO_HEIGHTS.search(str(channel.name or "")):
            break
    else:
        names = ", ".join(str(c.name) for c in channels) or "none is a length"
        what = f"holds no heights; its channels are images ({names})"
        raise DataError(what, "export the channel of heights")
    if channel.dim != 2:
        raise DataError("holds a profile", "measure a surface")
    columns, rows = (int(n) for n in channel.nb_grid_pts)
    check_size(rows, columns, most)
    return channel


def _raw_map(surface: Any, *, rows_stated: bool) -> RawMap:
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor

    if not surface.unit or surface.physical_sizes is None:
        raise DataError("does not state its unit or its size", "save it as .npz with z_mm and pitch_mm")
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
        bottom_first=not rows_stated,
        rows_stated=rows_stated,
    )
