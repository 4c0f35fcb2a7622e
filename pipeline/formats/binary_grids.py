"""Heights in binary grids of Surfer (.grd), Gwyddion (.gsf), MATLAB (.mat), TrueMap (.tmd) and NanoFocus (.nms), which
SurfaceTopography 1.27 reads not at all, or with rows for columns or nanometres for millimetres."""

from __future__ import annotations

import io
import re
import struct
import zlib
from pathlib import Path

import numpy as np

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.grid import MM
from pipeline.formats.kinds import SPARE_BYTES
from pipeline.formats.raw_map import RawMap, check_size, numbers_in

# Surfer 6: columns, rows, and the ends of x, y and z; Surfer 7: rows, columns, corner, steps, ends of z, turn, blank
_SURFER_6, _SURFER_7 = struct.Struct("<4shh6d"), struct.Struct("<ii8d")
_MOST_SECTIONS = 20
_GSF = b"Gwyddion Simple Field 1.0\n"
_MOST_HEAD_BYTES = 100_000
# columns and rows, width and height; bytes of these alone in version 1, and with the offsets in version 2
_TMD_SIZES, _TMD_1_BYTES, _TMD_2_BYTES = struct.Struct("<iiff"), 16, 24
_TMD_TITLE = re.compile(rb"(?i)(?:binary )?truemap data file")
_MOST_TMD_COMMENT = 4096
# lowest and highest height; columns, rows, and their distances
_NMS_RANGE, _NMS_GRID, _NMS_HEAD_BYTES = struct.Struct("<2d"), struct.Struct("<2I2d"), 3468
_MATLAB_PACKED = 15
_MATLAB_NUMBERS = (
    "double",
    "single",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


def read_grd(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a Surfer grid (text, version 6 or version 7), whose first row is the lowest."""
    data = path.read_bytes()
    if data.startswith(b"DSBB"):
        _, cols, rows, x, to_x, y, to_y, *_ = _SURFER_6.unpack_from(data)
        z = numbers_in(data, "<f4", _SURFER_6.size, (rows, cols), most)
        pitches = (to_x - x) / max(cols - 1, 1), (to_y - y) / max(rows - 1, 1)
        return RawMap(z, *pitches, bottom_first=True, rows_stated=True)
    if not data.startswith(b"DSRB"):
        from pipeline.formats.text_maps import read_text_map

        return read_text_map(path, most)
    sections: dict[bytes, int] = {}
    place = 0
    while b"DATA" not in sections and len(sections) < _MOST_SECTIONS:
        tag, size = struct.unpack_from("<4si", data, place)
        sections[tag] = place + 8
        place += 8 + max(size, 0)
    rows, cols, _, _, x_pitch, y_pitch, _, _, turn, blank = _SURFER_7.unpack_from(data, sections[b"GRID"])
    if turn:
        raise DataError(f"is a grid rotated by {turn:g} degrees", "export it without a rotation")
    z = numbers_in(data, "<f8", sections[b"DATA"], (rows, cols), most)
    return RawMap(np.where(z >= blank, np.nan, z), x_pitch, y_pitch, bottom_first=True, rows_stated=True)


def read_gsf(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a Gwyddion Simple Field, whose first row is the top one."""
    data = path.read_bytes()
    end = data.find(b"\0", 0, _MOST_HEAD_BYTES)
    if not data.startswith(_GSF) or end < 0:
        raise DataError("is damaged or not a Gwyddion Simple Field", "copy or export it again")
    lines = (line.partition("=") for line in data[len(_GSF) : end].decode("utf-8", "replace").splitlines())
    head = {key.strip(): value.strip() for key, _, value in lines}
    rows, cols = int(head["YRes"]), int(head["XRes"])
    if (unit := head.get("ZUnits", "")) not in MM:
        if not unit:
            raise DataError("states no unit of its values", "export the heights with their unit, such as m")
        raise DataError(f"holds no heights: its values have the unit {unit!r}", "export the heights")
    z = numbers_in(data, "<f4", end + 4 - end % 4, (rows, cols), most)
    pitches = float(head.get("XReal", 1.0)) / cols, float(head.get("YReal", 1.0)) / rows
    return RawMap(
        z, *pitches, z_mm=MM[unit], xy_mm=MM.get(head.get("XYUnits", "")), rows_stated=True, unit=unit
    )


def read_tmd(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a TrueMap file, in mm, whose first row is the top one.

    A title, and in some variants a comment, end with a zero, or are padded with more. Then come columns and rows, width
    and height, from version 2 on the offsets along x and y, and the heights. The place and kind of the numbers are
    those that leave exactly the heights, else those after the comment of version 2.
    """
    data = path.read_bytes()
    if not _TMD_TITLE.match(data):
        raise DataError("is damaged or not a TrueMap file", "copy or export it again")
    title_end = data.find(b"\0", 0, _MOST_HEAD_BYTES) + 1
    comment_end = data.find(b"\0", title_end, _MOST_HEAD_BYTES) + 1
    layouts = [
        (start, start + size)
        for start in range(title_end, min(title_end + _MOST_TMD_COMMENT, len(data) - _TMD_2_BYTES))
        for size in (_TMD_2_BYTES, _TMD_1_BYTES)
    ]
    for exact in (True, False):
        for start, end in layouts if exact else [(comment_end, comment_end + _TMD_2_BYTES)]:
            cols, rows, width, height = _TMD_SIZES.unpack_from(data, start)
            spare = len(data) - end - 4 * rows * cols
            if min(rows, cols) > 0 and min(width, height) > 0.0 and (spare == 0 or (spare > 0 and not exact)):
                z = numbers_in(data, "<f4", end, (rows, cols), most)
                return RawMap(
                    z, width / cols, height / rows, z_mm=1.0, xy_mm=1.0, rows_stated=True, unit="mm"
                )
    raise DataError("is damaged: its head does not fit its heights", "copy or export it again")


def read_nms(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a NanoFocus file, heights in um and distances in nm, whose first row is the top one."""
    data = path.read_bytes()
    low, high = _NMS_RANGE.unpack_from(data, 16)
    cols, rows, x_pitch, y_pitch = _NMS_GRID.unpack_from(data, 1368)
    counts = numbers_in(data, "<u2", _NMS_HEAD_BYTES, (rows, cols), most)
    z = low + counts * ((high - low) / 65534.0)
    return RawMap(z, x_pitch, y_pitch, z_mm=1e-3, xy_mm=1e-6, rows_stated=True, unit="um")


def read_mat(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read `z_mm` or the only matrix of a MATLAB file, and the number `pitch_mm` if there is one."""
    import h5py
    from scipy.io import loadmat, whosmat

    if h5py.is_hdf5(path):
        raise DataError(
            "is a MATLAB file of version 7.3", "save it with save(file, 'z_mm', 'pitch_mm', '-v7')"
        )
    file = _unpacked_matlab(path.read_bytes(), most)
    shapes = {name: shape for name, shape, kind in whosmat(file) if kind in _MATLAB_NUMBERS}
    matrices = [name for name, shape in shapes.items() if len(shape) == 2 and min(shape) > 1]
    if "z_mm" not in matrices and len(matrices) != 1:
        what = f"holds {len(matrices)} matrices ({', '.join(matrices)[:100] or 'none'})"
        raise DataError(what, "save the heights as z_mm, and their distance as pitch_mm")
    name = "z_mm" if "z_mm" in matrices else matrices[0]
    check_size(shapes[name][0], shapes[name][1], most)
    file.seek(0)
    held = loadmat(file, variable_names=[name, "pitch_mm"])
    pitch = float(held["pitch_mm"].item()) if shapes.get("pitch_mm") == (1, 1) else None
    return RawMap(held[name], pitch, pitch)


def _unpacked_matlab(data: bytes, most: int) -> io.BytesIO:
    if 0 in data[:4]:  # version 4, which is not packed
        return io.BytesIO(data)
    tag = struct.Struct("<II" if data[126:128] == b"IM" else ">II")
    spare_bytes, place, unpacked = 8 * most + SPARE_BYTES, 128, io.BytesIO(data[:128])
    unpacked.seek(place)
    while place + tag.size <= len(data):
        kind, size = tag.unpack_from(data, place)
        end = place + tag.size + size
        part = data[place:end]
        if kind == _MATLAB_PACKED:
            part = zlib.decompressobj().decompress(part[tag.size :], spare_bytes + 1)
            spare_bytes -= len(part)
            if spare_bytes < 0:
                raise DataError(f"unpacks to more than {most:,} samples", "save the heights alone")
        unpacked.write(part)
        place = end
    unpacked.seek(0)
    return unpacked
