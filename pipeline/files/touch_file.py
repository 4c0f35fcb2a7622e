"""One file, by its suffix: a height map or a scan."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, require_file
from pipeline.files.units import Unit

if TYPE_CHECKING:
    from glyphs.surface.maps import HeightMap
    from pipeline.files.instruments import RowOrder
    from whisker_array.scan.scan import Scan

__all__ = [
    "FileError",
    "is_height_map",
    "is_photo",
    "is_scan",
    "read_height_map",
    "read_scan",
    "row_order_matters",
]

MESH_SUFFIXES = (".stl", ".ply", ".xyz", ".asc")
CORE_SUFFIXES = (".npz", ".x3p", ".sdf", *MESH_SUFFIXES)
FORMATS_SUFFIXES = (
    *(".al3d", ".apx", ".bcr", ".bcrf", ".datx", ".ezd", ".frt", ".gwy", ".ibw", ".jpk", ".lext", ".mdt"),
    *(".mi", ".mnt", ".nid", ".nms", ".oir", ".opd", ".opdx", ".os3d", ".plu", ".plux", ".poir", ".qep"),
    *(".spm", ".sur", ".tmd", ".vk3", ".vk4", ".vk6", ".vk7", ".zmg", ".zon"),
)
"""Formats of the extra `formats` whose suffix means a height map and nothing else; any other suffix (.dat,
.txt) is tried too when the file is named on its own."""
SCAN_SUFFIXES = (".h5", ".hdf5")
PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
MAX_SCAN_BYTES = 4_000_000_000


def is_height_map(path: Path) -> bool:
    """Whether the suffix is that of a height map."""
    return path.suffix.lower() in CORE_SUFFIXES + FORMATS_SUFFIXES


def is_scan(path: Path) -> bool:
    """Whether the suffix is that of a recorded scan."""
    return path.suffix.lower() in SCAN_SUFFIXES


def is_photo(path: Path) -> bool:
    """Whether the suffix is that of a photograph."""
    return path.suffix.lower() in PHOTO_SUFFIXES


def row_order_matters(path: Path) -> bool:
    """Whether files of this format are met with either row first (`pipeline.files.instruments`)."""
    return path.suffix.lower() in (".x3p", ".sdf")


def read_height_map(
    path: str | Path, *, row_order: RowOrder | None = None, unit: Unit = Unit.MM
) -> HeightMap:
    """The height map in a file, mm, row 0 at the top.

    Args:
        path: the file; its suffix says which format it is.
        row_order: of an X3P or SDF file, the standards' unless given.
        unit: of the numbers in a format that states none: .npz, STL, PLY, XYZ.

    Raises:
        FileError: whatever keeps it from being read, and what to do about it.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        from pipeline.files.npz import read_npz

        return read_npz(path, unit=unit)
    if suffix in MESH_SUFFIXES:
        from pipeline.files.meshes import read_mesh

        return read_mesh(path, unit=unit)
    from pipeline.files import instruments

    order = instruments.RowOrder.STANDARD if row_order is None else row_order
    if suffix == ".x3p":
        return instruments.read_x3p(path, row_order=order)
    if suffix == ".sdf":
        return instruments.read_sdf(path, row_order=order)
    return instruments.read_with_surface_topography(path, row_order=order)


def read_scan(path: str | Path) -> Scan:
    """The scan in a recording.

    Raises:
        FileError: whatever keeps it from being read, and how to correct it.
    """
    from whisker_array.scan.recording import load_scan

    require_file(Path(path), most_bytes=MAX_SCAN_BYTES)
    return load_scan(path)
