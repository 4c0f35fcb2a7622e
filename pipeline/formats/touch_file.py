"""One file, by its suffix: a height map or a scan."""

from __future__ import annotations

from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from glyphs.errors import FileError, require_file
from pipeline.common.settings import MapSettings

if TYPE_CHECKING:
    from glyphs.surface.maps import HeightMap
    from pipeline.formats.raw_map import RawMap
    from whisker_array.scan.scan import Scan

__all__ = [
    "FileError",
    "is_height_map",
    "is_photo",
    "is_scan",
    "read_height_map",
    "read_map_and_rows",
    "read_scan",
]

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".pcd")
TEXT_SUFFIXES = (".xyz", ".asc", ".pts")
TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat")
"""Text that may hold heights and may hold anything else: read where it is named on its own."""
CORE_SUFFIXES = (".npz", ".npy", ".x3p", ".sdf", *MESH_SUFFIXES, *TEXT_SUFFIXES)
FORMATS_SUFFIXES = (
    *(".al3d", ".apx", ".bcr", ".bcrf", ".datx", ".ezd", ".frt", ".gwy", ".ibw", ".jpk", ".lext", ".mdt"),
    *(".mi", ".mnt", ".nid", ".nms", ".oir", ".opd", ".opdx", ".os3d", ".plu", ".plux", ".poir", ".qep"),
    *(".spm", ".sur", ".tmd", ".vk3", ".vk4", ".vk6", ".vk7", ".zmg", ".zon"),
)
"""Formats of the extra `formats` whose suffix means a height map and nothing else; any other suffix is tried, too,
when the file is named on its own."""
SCAN_SUFFIXES = (".h5", ".hdf5")
PHOTO_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".jif", ".bmp", ".dib", ".tif", ".tiff", ".webp", ".gif"),
)
UNREAD_PICTURE_SUFFIXES = (
    *(".heic", ".heif", ".avif", ".jxl", ".jp2", ".j2k", ".psd"),
    *(".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".raf", ".rw2"),
)
"""Pictures that are not read: passed over in folders, refused with the kinds that are read where named."""
HEIGHT_IMAGE_SUFFIXES = (".png", ".tif", ".tiff")
MAX_SCAN_BYTES = 4_000_000_000


def is_height_map(path: PurePath) -> bool:
    """Whether the suffix is that of a height map."""
    return path.suffix.lower() in CORE_SUFFIXES + FORMATS_SUFFIXES + TABLE_SUFFIXES


def is_scan(path: PurePath) -> bool:
    """Whether the suffix is that of a recorded scan."""
    return path.suffix.lower() in SCAN_SUFFIXES


def is_photo(path: PurePath) -> bool:
    """Check whether a suffix is that of a supported photograph."""
    return path.suffix.lower() in PHOTO_SUFFIXES


def read_height_map(path: str | Path, settings: MapSettings | None = None) -> HeightMap:
    """The height map in a file, mm, row 0 at the top.

    Args:
        path: the file; its suffix says which format it is.
        settings: unit, pitch, kind and order of rows that are given; the file's own unless given.

    Raises:
        FileError: whatever keeps it from being read, and what to do about it.
    """
    return read_map_and_rows(path, settings)[0]


def read_map_and_rows(path: str | Path, settings: MapSettings | None = None) -> tuple[HeightMap, bool]:
    """The height map in a file, and whether the order of its rows is known: stated by the file or given.

    Args:
        path: as of `read_height_map`.
        settings: likewise.

    Raises:
        FileError: likewise.
    """
    from pipeline.formats.grids import height_map

    path, settings = Path(path), settings or MapSettings()
    raw = read_raw(path, settings)
    return height_map(path, raw, settings), raw.rows_stated or settings.rows is not None


def read_raw(path: Path, settings: MapSettings) -> RawMap:
    """The heights of a file in its own numbers.

    Raises:
        FileError: whatever keeps it from being read, and what to do about it.
    """
    suffix = path.suffix.lower()
    if suffix in (".npz", ".npy"):
        from pipeline.formats import npz

        return npz.read_npz(path) if suffix == ".npz" else npz.read_npy(path)
    if suffix == ".x3p":
        from pipeline.formats.x3p import read_x3p

        return read_x3p(path)
    if suffix in MESH_SUFFIXES:
        from pipeline.formats.meshes import read_mesh

        return read_mesh(path)
    if suffix in PHOTO_SUFFIXES:
        from pipeline.formats.height_images import read_height_image

        return read_height_image(path)
    from pipeline.formats import instruments

    if suffix == ".sdf":
        return instruments.read_sdf(path)
    from pipeline.formats.number_table import is_number_table

    known = suffix in FORMATS_SUFFIXES
    if suffix in TEXT_SUFFIXES or (not known and is_number_table(path)):
        from pipeline.formats.text_maps import read_text_map

        return read_text_map(path)
    return instruments.read_with_surface_topography(path, known=known)


def read_scan(path: str | Path) -> Scan:
    """The scan in a recording.

    Raises:
        FileError: whatever keeps it from being read, and how to correct it.
    """
    from whisker_array.scan.recording import load_scan

    require_file(Path(path), most_bytes=MAX_SCAN_BYTES)
    return load_scan(path)
