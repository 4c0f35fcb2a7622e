"""Height maps as `.npz`: `z_mm` (rows, cols) in mm, NaN for dropouts, row 0 at the top, and one `pitch_mm`.

Beside them may lie what is on the part: `friction`, `soft_mm` (thickness of dirt that yields, under `z_mm` as its
top) and `hardness_mpa`, each a map on the same grid or one number; and `rows`, which says that the first row is the
top one ("top-first") or the lowest one ("bottom-first"). A file without it may have been written either way.

The header of a member is looked at before the member is unpacked: what is too large or of the wrong type is
refused without taking the memory.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, damage_reported, require_file
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import MAX_PIXELS, HeightMap
from pipeline.common.atomic import replacing
from pipeline.common.settings import MapSettings
from pipeline.formats.grids import MAX_HEIGHT_MM, check_size
from pipeline.formats.raw_map import RawMap
from whisker_array.whisker.defaults import NOMINAL_FRICTION

MAX_FILE_BYTES = 1_000_000_000
_HEADER_BYTES = 10_000
_NEEDED = ("z_mm", "pitch_mm")
_ROWS = ("top-first", "bottom-first")
DEFAULT_HARDNESS_MPA = 10.0
"""Of caked grime, where a file gives a thickness and no hardness."""


@dataclass(frozen=True)
class _SoilMember:
    """What a member may hold, and what stands for it where it is missing."""

    missing: float
    least: float
    most: float
    hint: str


_SOIL = {
    "friction": _SoilMember(
        NOMINAL_FRICTION, 0.0, 2.0, "give Coulomb coefficients from 0 to 2, mostly 0.05 to 0.6"
    ),
    "soft_mm": _SoilMember(
        0.0, 0.0, MAX_HEIGHT_MM, "give the thickness of soft dirt in mm, 0 where there is none"
    ),
    "hardness_mpa": _SoilMember(
        DEFAULT_HARDNESS_MPA,
        1e-4,
        1e6,
        "give the pressure in MPa at which the dirt yields, grease 0.1, grime 10",
    ),
}


@dataclass(frozen=True)
class _Member:
    """What the header of one array says."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]

    @property
    def size(self) -> int:
        count = 1
        for n in self.shape:
            count *= n
        return count


def read_npz(path: Path) -> RawMap:
    """The heights of an `.npz` file.

    Raises:
        FileError: anything that keeps the file from being one.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with damage_reported(path, kind=".npz"), zipfile.ZipFile(path) as archive:
        for name in _NEEDED:
            if f"{name}.npy" not in archive.namelist():
                held = ", ".join(sorted(n.removesuffix(".npy") for n in archive.namelist())) or "nothing"
                raise FileError(
                    path, f"has no {name} (it holds {held[:100]})", "save z_mm and pitch_mm in it"
                )
        heights, distance = (_look(path, archive, name) for name in _NEEDED)
        _check_heights(path, heights)
        if distance.size != 1:
            raise FileError(path, f"pitch_mm has shape {distance.shape}", "give one number, mm")
        pitch = float(_load(archive, "pitch_mm").reshape(()))
        rows = _rows(path, archive)
        return RawMap(
            _load(archive, "z_mm"),
            pitch,
            pitch,
            bottom_first=rows == "bottom-first",
            rows_stated=rows is not None,
        )


def _rows(path: Path, archive: zipfile.ZipFile) -> str | None:
    """Which row is first, as the file states it."""
    if "rows.npy" not in archive.namelist():
        return None
    with archive.open("rows.npy") as stream:
        member = _header(path, "rows", stream, kinds="U")
        if member.size == 1 and member.dtype.itemsize <= _HEADER_BYTES:
            stream.seek(0)
            stated = str(np.lib.format.read_array(stream, allow_pickle=False).item())
            if stated in _ROWS:
                return stated
    raise FileError(
        path, "states no order of its rows", f"save rows as {' or '.join(_ROWS)}, or leave it out"
    )


def read_npy(path: Path) -> RawMap:
    """The heights of an `.npy` file: a matrix, or rows x, y, z.

    Raises:
        FileError: anything that keeps the file from being one.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with damage_reported(path, kind=".npy"), path.open("rb") as stream:
        member = _header(path, path.name, stream)
        if len(member.shape) == 2 and member.shape[1] == 3:
            from pipeline.formats.meshes import map_of_points

            if member.size > 3 * MAX_PIXELS:
                check_size(path, *member.shape)
            stream.seek(0)
            return map_of_points(path, np.lib.format.read_array(stream, allow_pickle=False))
        _check_heights(path, member)
        stream.seek(0)
        return RawMap(np.lib.format.read_array(stream, allow_pickle=False))


def read_soil(path: Path, settings: MapSettings | None = None) -> Soil | None:
    """What lies on the part of an `.npz` file, on the grid of its `z_mm`; None if the file tells nothing of it.

    A member that is missing beside another is filled in: no soft dirt, hardness of caked grime, nominal friction.

    Args:
        path: the file.
        settings: order of rows that is given.

    Raises:
        FileError: a member of another shape, not finite or out of range; or a file that cannot be read.
    """
    require_file(path, most_bytes=MAX_FILE_BYTES)
    with damage_reported(path, kind=".npz"), zipfile.ZipFile(path) as archive:
        held = [name for name in _SOIL if f"{name}.npy" in archive.namelist()]
        if not held:
            return None
        if "z_mm.npy" not in archive.namelist():
            raise FileError(path, f"has {held[0]} and no z_mm", "save the height map with it")
        heights = _look(path, archive, "z_mm")
        _check_heights(path, heights)
        for name in held:
            member = _look(path, archive, name)
            if member.shape != heights.shape and member.size != 1:
                raise FileError(
                    path,
                    f"{name} has shape {member.shape}, z_mm {heights.shape}",
                    "give both on one grid, or one number",
                )
        values = {name: _load_soil(path, archive, name) for name in held}
        shape = (heights.shape[0], heights.shape[1])
        friction, soft, hardness = (
            np.broadcast_to(values.get(name, np.float32(member.missing)), shape)
            for name, member in _SOIL.items()
        )
        found = Soil(thickness_mm=soft, hardness_mpa=hardness, friction=friction)
        rows = (settings.rows if settings is not None else None) or _rows(path, archive)
        return found.mirrored if rows == "bottom-first" else found


def _load_soil(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray[np.float32]:
    values, rule = _load(archive, name), _SOIL[name]
    if not np.isfinite(values).all():
        raise FileError(path, f"{name} is not finite at {np.sum(~np.isfinite(values)):,} samples", rule.hint)
    # in the member's own precision: float32 would turn 1e300 into an infinity
    low, high = float(values.min()), float(values.max())
    if low < rule.least or high > rule.most:
        raise FileError(path, f"{name} runs from {low:.3g} to {high:.3g}", rule.hint)
    return np.asarray(values if values.size > 1 else values.reshape(()), dtype=np.float32)


def soil_members(soil: Soil) -> dict[str, object]:
    """The arrays that `read_soil` looks for, to be written with `write_npz(more=)`."""
    return {"friction": soil.friction, "soft_mm": soil.thickness_mm, "hardness_mpa": soil.hardness_mpa}


def _look(path: Path, archive: zipfile.ZipFile, name: str) -> _Member:
    """Read the header of one member, and check that the archive holds as much as it declares."""
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as stream:
        member = _header(path, name, stream)
    if member.size <= MAX_PIXELS and info.file_size < member.size * member.dtype.itemsize:
        raise FileError(path, f"{name} is shorter than it declares", "copy or save it again")
    return member


def _header(path: Path, name: str, stream: IO[bytes], *, kinds: str = "fiu") -> _Member:
    version = np.lib.format.read_magic(stream)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise FileError(path, f"{name} is stored in npy version {version}", "save it with numpy.savez")
    shape, _, dtype = readers[version](stream, max_header_size=_HEADER_BYTES)
    if dtype.hasobject or dtype.kind not in kinds:
        hint = "it must hold real numbers" if kinds == "fiu" else "it must hold a text"
        raise FileError(path, f"{name} is of type {dtype}", hint)
    return _Member(shape, dtype)


def _check_heights(path: Path, heights: _Member) -> None:
    if len(heights.shape) != 2 or min(heights.shape) < 2:
        raise FileError(
            path, f"its heights have shape {heights.shape}", "give rows x columns, at least 2 x 2"
        )
    check_size(path, heights.shape[0], heights.shape[1])


def _load(archive: zipfile.ZipFile, name: str) -> NDArray[np.float64]:
    with archive.open(f"{name}.npy") as stream:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def write_npz(path: Path, height_map: HeightMap, *, more: Mapping[str, object] | None = None) -> None:
    """Write a height map; the file appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    pitch = np.float64(height_map.pitch_mm)
    arrays = {"z_mm": height_map.z_mm, "pitch_mm": pitch, "rows": np.str_("top-first"), **(more or {})}
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
