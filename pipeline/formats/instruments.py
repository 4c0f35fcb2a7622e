"""Height maps as instruments write them: X3P and SDF (ISO 25178) by x3pio and sdfio, others with the extra `formats`.

The first row of X3P and SDF is the lowest one of the part, unless the `Origin` of an X3P is in the north or its
increment along y is negative. In SurfaceTopography's `heights()[x, y]`, transposed, other formats have it at the top.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
import tempfile
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.hdf5_checks import check_hdf5
from pipeline.formats.kinds import BYTES_PER_SAMPLE, FORMATS_SUFFIXES, SPARE_BYTES, TABLE_SUFFIXES
from pipeline.formats.raw_map import PROFILE, RawMap, check_size
from pipeline.formats.zip_checks import check_zip

_NO_HEIGHTS = re.compile(
    r"intens|light|laser|image|colou?r|amplitude|phase|error|deflection|quality", re.IGNORECASE
)
_NO_FORMAT = (
    "is in no format that is read as heights (.npz, .npy, .x3p, .sdf, .sur, .opd, .stl, .ply, .obj, .pcd, and text: "
    "x y z columns or a matrix)"
)
# first bytes of archives, refused unless the suffix is that of a supported format
_PACKED = {
    **{b"\x1f\x8b": "packed (gzip)", b"7z\xbc\xaf": "packed (7z)", b"Rar!": "packed (RAR)"},
    b"PK\x03\x04": "a workbook or packed (ZIP)",
}
# bytes of a text's first line: a row of 40,000 heights has half as many
_LONGEST_LINE = 1_000_000
_EXPORT = "export it as X3P, PLY or columns x y z, or save .npz with z_mm and pitch_mm"
_OTHER_UNIT = re.compile(r"Unknown unit '(.*)'\.?|.* while unit '(.*)' is of kind .*")


def read_instrument(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of a file, through SurfaceTopography. Raises DataError: it cannot be used, or no `formats`."""
    with path.open("rb") as stream:
        head = stream.read(_LONGEST_LINE)
    if len(head) == _LONGEST_LINE and not re.search(rb"[\0\n\r]", head):
        # a text without lines: every one of the library's parsers would search it to its end
        raise DataError(_NO_FORMAT, _EXPORT)
    if head.startswith(b"DSCOMPRESSED"):
        raise DataError("is compressed", "save it uncompressed, or export it as X3P")
    named = path.suffix.lower() in FORMATS_SUFFIXES
    packed = next((name for magic, name in _PACKED.items() if head.startswith(magic)), "")
    if packed and not named:
        raise DataError(f"is {packed}", "unpack it, or save its sheet as CSV")
    import h5py

    if h5py.is_hdf5(path):
        check_hdf5(path, most=most)
    if zipfile.is_zipfile(path):
        check_zip(path, most_bytes=most * BYTES_PER_SAMPLE + SPARE_BYTES)
    with _silence():
        try:
            from SurfaceTopography.Exceptions import CannotDetectFileFormat
            from SurfaceTopography.IO import open_topography
        except ModuleNotFoundError as error:
            what = f"is of a format ({path.suffix or 'no suffix'}) that needs the extra `formats`"
            raise DataError(what, "install it with: pip install 'tactile-marks[formats]'") from error
        try:
            with open_topography(str(path)) as reader:
                # Gwyddion's masks are the user's selections, not missing data
                getattr(reader, "_masks", {}).clear()
                channel = _height_channel(reader, most)
                surface = reader.topography(channel_index=channel.index)
                # X3P and SDF files occur with either row first
                return _raw_map(surface, rows_stated=path.suffix.lower() not in (".x3p", ".sdf"))
        except CannotDetectFileFormat as error:
            if named:
                raise DataError(f"is damaged or no {path.suffix} file", "copy or export it again") from error
            listed = "; if it lists parts, give it with --manifest" if path.suffix in TABLE_SUFFIXES else ""
            raise DataError(_NO_FORMAT, _EXPORT + listed) from error
        except ValueError as error:
            if not (mismatch := _OTHER_UNIT.fullmatch(str(error))):
                raise
            unit = (mismatch[1] or mismatch[2] or "").strip()
            what = f"an image (z in {unit!r}), no heights" if unit else "no heights: z has no unit of length"
            raise DataError(f"holds {what}", "export the channel of heights") from error


@contextlib.contextmanager
def _silence() -> Iterator[None]:
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
        raise DataError(*PROFILE)
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
        unit=str(surface.unit),
    )


# unpacked description (main.xml), bytes: real ones are far smaller
_MOST_DESCRIPTION_BYTES = 16_000_000
_IN_MEMORY_BYTES = 64_000_000
_MAIN, _CHECKSUM = "main.xml", "md5checksum.hex"
_ROOT = re.compile(rb"<(/?(?:\w+:)?)ISO5436(?=[\s>])")
_ORIGIN = re.compile(rb"<(?:\w+:)?Origin>\s*([NS])", re.IGNORECASE)


def read_sdf(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """An SDF surface, binary or text, in metres."""
    import sdfio

    surface = sdfio.read(path)
    rows, cols = surface.data.shape
    check_size(rows, cols, most)
    pitches = surface.header.x_scale, surface.header.y_scale
    return RawMap(np.asarray(surface.data), *pitches, z_mm=1e3, xy_mm=1e3, bottom_first=True)


def read_x3p(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The first layer of an X3P surface, in metres. An unusual root element or an outdated checksum of the description
    is passed over; the checksum of the heights must match."""
    import x3pio

    check_zip(path, most_bytes=_MOST_DESCRIPTION_BYTES, ending=".xml")
    with zipfile.ZipFile(path) as archive:
        (main,) = (n for n in archive.namelist() if n.split("/")[-1] == _MAIN and "__MACOSX" not in n)
        description = _ROOT.sub(rb"<\1ISO5436_2", archive.read(main))
        head = io.BytesIO()
        with zipfile.ZipFile(head, "w") as alone:
            alone.writestr(_MAIN, description)
        info = x3pio.info(head, verify=False)
        if info.feature_type is not x3pio.FeatureType.SURFACE or len(info.shape) != 2:
            kind = info.feature_type.name.lower().replace("_", " ")
            raise DataError(
                f"holds a {kind}", PROFILE[1] if kind == "profile" else "export a surface on a grid"
            )
        rows, cols = info.shape
        check_size(rows, cols * info.layer_count, most)
        x, y = info.header.x, info.header.y
        if not (x.is_incremental and y.is_incremental):
            raise DataError("holds points off a regular grid", "export the surface on a regular grid")
        needed = rows * cols * info.layer_count * BYTES_PER_SAMPLE
        check_zip(path, most_bytes=SPARE_BYTES + needed)
        with tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY_BYTES) as copy:
            with zipfile.ZipFile(copy, "w") as mended:
                for name in archive.namelist():
                    if name.split("/")[-1] not in ("", _CHECKSUM):
                        mended.writestr(name, description if name == main else archive.read(name))
            copy.seek(0)
            surface = x3pio.read(copy)
    origin, downwards = _ORIGIN.search(description), y.increment < 0.0
    return RawMap(
        np.asarray(surface.layers[0].z),
        abs(x.increment),
        abs(y.increment),
        z_mm=1e3,
        xy_mm=1e3,
        bottom_first=not downwards if origin is None else origin[1] in b"sS",
        rows_stated=downwards or origin is not None,
    )
