"""Heights in binary grids of other programs: Surfer (.grd), Gwyddion Simple Field (.gsf) and MATLAB (.mat)."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.grid import MM
from pipeline.formats.raw_map import RawMap, check_size

# Surfer 6: columns, rows, and the ends of x, y and z; Surfer 7: rows, columns, corner, steps, ends of z, turn, blank
_SURFER_6, _SURFER_7 = struct.Struct("<4shh6d"), struct.Struct("<ii8d")
_MOST_SECTIONS = 20
_GSF = b"Gwyddion Simple Field 1.0\n"
_MOST_HEAD_BYTES = 100_000
_MATLAB_NUMBERS = (
    "double",
    "single",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


def read_grd(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a Surfer grid (text, version 6 or version 7), whose first row is the lowest.

    Raises:
        DataError: the file cannot be used.
    """
    data = path.read_bytes()
    if data.startswith(b"DSBB"):
        _, cols, rows, x, to_x, y, to_y, *_ = _SURFER_6.unpack_from(data)
        z = _matrix(data, "<f4", _SURFER_6.size, (rows, cols), most)
        pitches = (to_x - x) / max(cols - 1, 1), (to_y - y) / max(rows - 1, 1)
        return RawMap(z, *pitches, bottom_first=True, rows_stated=True)
    if not data.startswith(b"DSRB"):
        from pipeline.formats.text_maps import read_text_map

        return read_text_map(path, most)
    sections: dict[bytes, int] = {}
    at = 0
    while b"DATA" not in sections and len(sections) < _MOST_SECTIONS:
        tag, size = struct.unpack_from("<4si", data, at)
        sections[tag] = at = at + 8
        at += max(size, 0)
    rows, cols, _, _, x_pitch, y_pitch, _, _, turn, blank = _SURFER_7.unpack_from(data, sections[b"GRID"])
    if turn:
        raise DataError(f"is a grid rotated by {turn:g} degrees", "export it without a rotation")
    z = _matrix(data, "<f8", sections[b"DATA"], (rows, cols), most)
    return RawMap(np.where(z >= blank, np.nan, z), x_pitch, y_pitch, bottom_first=True, rows_stated=True)


def read_gsf(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read a Gwyddion Simple Field, whose first row is the top one.

    Raises:
        DataError: the file cannot be used.
    """
    data = path.read_bytes()
    end = data.find(b"\0", 0, _MOST_HEAD_BYTES)
    if not data.startswith(_GSF) or end < 0:
        raise DataError("is damaged or not a Gwyddion Simple Field", "copy or export it again")
    lines = (line.partition("=") for line in data[len(_GSF) : end].decode("utf-8", "replace").splitlines())
    head = {key.strip(): value.strip() for key, _, value in lines}
    rows, cols = int(head["YRes"]), int(head["XRes"])
    if (unit := head.get("ZUnits", "")) not in MM:
        raise DataError(f"holds no heights: its values have the unit {unit!r}", "export the heights")
    z = _matrix(data, "<f4", end + 4 - end % 4, (rows, cols), most)
    pitches = float(head.get("XReal", 1.0)) / cols, float(head.get("YReal", 1.0)) / rows
    return RawMap(z, *pitches, z_mm=MM[unit], xy_mm=MM.get(head.get("XYUnits", "")), rows_stated=True)


def _matrix(data: bytes, kind: str, start: int, shape: tuple[int, int], most: int) -> NDArray[np.floating]:
    check_size(*shape, most)
    return np.frombuffer(data, kind, count=math.prod(shape), offset=start).reshape(shape)


def read_mat(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read `z_mm` or the only matrix of a MATLAB file, and the number `pitch_mm` if there is one.

    Raises:
        DataError: the file cannot be used.
    """
    import h5py
    from scipy.io import loadmat, whosmat

    if h5py.is_hdf5(path):
        raise DataError(
            "is a MATLAB file of version 7.3", "save it with save(file, 'z_mm', 'pitch_mm', '-v7')"
        )
    shapes = {name: shape for name, shape, kind in whosmat(path) if kind in _MATLAB_NUMBERS}
    matrices = [name for name, shape in shapes.items() if len(shape) == 2 and min(shape) > 1]
    if "z_mm" not in matrices and len(matrices) != 1:
        what = f"holds {len(matrices)} matrices ({', '.join(matrices)[:100] or 'none'})"
        raise DataError(what, "save the heights as z_mm, and their distance as pitch_mm")
    name = "z_mm" if "z_mm" in matrices else matrices[0]
    check_size(shapes[name][0], shapes[name][1], most)
    held = loadmat(path, variable_names=[name, "pitch_mm"])
    pitch = float(held["pitch_mm"].item()) if shapes.get("pitch_mm") == (1, 1) else None
    return RawMap(held[name], pitch, pitch)
