"""Height maps as `.npz`: `z_mm` (rows, cols) in mm, NaN for dropouts, row 0 at the top, and one `pitch_mm`.

Optional members describe dirt: `friction`, `soft_mm` (thickness of dirt that yields, with `z_mm` as its top) and
`hardness_mpa`, each a map on the same grid or one number. `rows` ("top-first", "bottom-first") states the order of
rows. A member's header is checked before it is unpacked.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import MAX_PIXELS, HeightMap
from pipeline.errors import DataError
from pipeline.formats.grid import MAX_HEIGHT_MM
from pipeline.formats.raw_map import RawMap, check_size
from pipeline.formats.zip_checks import check_zip
from whisker_array.whisker.defaults import NOMINAL_FRICTION

_HEADER_BYTES = 10_000
_ROWS = ("top-first", "bottom-first")
# of caked grime, for a file with a thickness but no hardness
DEFAULT_HARDNESS_MPA = 10.0


@dataclass(frozen=True)
class _SoilMember:
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
        *(DEFAULT_HARDNESS_MPA, 1e-4, 1e6),
        "give the pressure in MPa at which the dirt yields, grease 0.1, grime 10",
    ),
}


def _array(
    stream: IO[bytes], name: str, held: int, check: Callable[[tuple[int, ...]], None], *, kinds: str = "fiu"
) -> NDArray[Any]:
    version = np.lib.format.read_magic(stream)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise DataError(f"{name} is stored in npy version {version}", "save it with numpy.savez")
    shape, _, dtype = readers[version](stream, max_header_size=_HEADER_BYTES)
    if dtype.hasobject or dtype.kind not in kinds:
        hint = "it must hold real numbers" if kinds == "fiu" else "it must hold a text"
        raise DataError(f"{name} is of type {dtype}", hint)
    check(shape)
    if held < math.prod(shape) * dtype.itemsize:
        raise DataError(f"{name} is shorter than it declares", "copy or save it again")
    stream.seek(0)
    return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def _check_heights(shape: tuple[int, ...], most: int = MAX_PIXELS) -> None:
    if len(shape) != 2 or min(shape) < 1:
        raise DataError(f"its heights have shape {shape}", "give rows x columns, at least 2 x 2")
    check_size(*shape, most)


class _Archive(zipfile.ZipFile):
    def __init__(self, path: Path) -> None:
        check_zip(path)
        super().__init__(path)
        self.members = {name.removesuffix(".npy") for name in self.namelist()}

    def load(
        self, name: str, check: Callable[[tuple[int, ...]], None], *, kinds: str = "fiu"
    ) -> NDArray[Any]:
        with self.open(f"{name}.npy") as stream:
            return _array(stream, name, self.getinfo(f"{name}.npy").file_size, check, kinds=kinds)

    def item(self, name: str, *, kinds: str = "fiu") -> Any:

        def check(shape: tuple[int, ...]) -> None:
            if math.prod(shape) != 1 or self.getinfo(f"{name}.npy").file_size > _HEADER_BYTES:
                raise DataError(f"{name} has shape {shape}", "give one value")

        return self.load(name, check, kinds=kinds).item()

    def rows(self) -> str | None:
        if "rows" not in self.members:
            return None
        if (stated := self.item("rows", kinds="U")) not in _ROWS:
            raise DataError(f"has rows = {stated!r}", f"save rows as {' or '.join(_ROWS)}, or leave it out")
        return str(stated)

    def soil(self, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        rule = _SOIL[name]
        if name not in self.members:
            return np.broadcast_to(np.float32(rule.missing), shape)

        def check(held: tuple[int, ...]) -> None:
            if held != shape and math.prod(held) != 1:
                raise DataError(
                    f"{name} has shape {held}, z_mm {shape}", "give both on one grid, or one number"
                )

        values = self.load(name, check)
        if not np.isfinite(values).all():
            raise DataError(f"{name} is not finite at {np.sum(~np.isfinite(values)):,} samples", rule.hint)
        # in the member's own precision: float32 would turn 1e300 into an infinity
        low, high = float(values.min()), float(values.max())
        if low < rule.least or high > rule.most:
            raise DataError(f"{name} runs from {low:.3g} to {high:.3g}", rule.hint)
        return np.broadcast_to((values if values.size > 1 else values.reshape(())).astype(np.float32), shape)


def read_npz(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of an `.npz` file, and the dirt on the part, whose missing members have defaults."""
    with _Archive(path) as archive:
        for name in ("z_mm", "pitch_mm"):
            if name not in archive.members:
                held = ", ".join(sorted(archive.members)) or "nothing"
                raise DataError(f"has no {name} (it holds {held[:100]})", "save z_mm and pitch_mm in it")
        z = archive.load("z_mm", partial(_check_heights, most=most))
        pitch, rows, soil = float(archive.item("pitch_mm")), archive.rows(), None
        if not _SOIL.keys().isdisjoint(archive.members):
            friction, soft, hardness = (archive.soil(name, z.shape) for name in _SOIL)
            soil = Soil(thickness_mm=soft, hardness_mpa=hardness, friction=friction)
        first = rows == "bottom-first"
        return RawMap(z, pitch, pitch, bottom_first=first, rows_stated=rows is not None, soil=soil)


def read_npy(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """The heights of an `.npy` file: a matrix, or rows x, y, z."""

    def check(shape: tuple[int, ...]) -> None:
        if shape[1:] == (3,):
            check_size(shape[0], 3, 3 * most)
        else:
            _check_heights(shape, most)

    with path.open("rb") as stream:
        values = _array(stream, path.name, path.stat().st_size, check)
    if values.shape[1] != 3:
        return RawMap(values)
    from pipeline.formats.points import map_of_points

    return map_of_points(values, most=most)


def soil_members(soil: Soil) -> dict[str, object]:
    """The arrays that `read_npz` looks for, to be written with `write_npz(more=)`."""
    return {"friction": soil.friction, "soft_mm": soil.thickness_mm, "hardness_mpa": soil.hardness_mpa}


def write_npz(path: str | Path, height_map: HeightMap, *, more: Mapping[str, object] | None = None) -> None:
    """Write a height map; the file appears whole or not at all. Raises FileError: it cannot be written."""
    pitch = np.float64(height_map.pitch_mm)
    arrays = {"z_mm": height_map.z_mm, "pitch_mm": pitch, "rows": np.str_("top-first"), **(more or {})}
    with replacing(Path(path)) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
