"""Read a height map or a scan from a file, by its suffix."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.settings import MapSettings
from pipeline.errors import DataError, naming, reading
from pipeline.formats.hdf5_checks import check_hdf5, hdf5_damage
from pipeline.formats.kinds import (
    BYTES_PER_SAMPLE,
    INSTRUMENT_READER,
    MOST_BYTES,
    PHOTO_SUFFIXES,
    READERS,
    SPARE_BYTES,
    TEXT_READER,
)

if TYPE_CHECKING:
    from glyphs.surface.maps import HeightMap
    from pipeline.formats.raw_map import RawMap
    from recognition.surface import Surface
    from whisker_array.scan.scan import Scan

# readers of files that are height maps only if the user says so
_NAMED = {
    ".mat": ("binary_grids.read_mat", "MATLAB"),
    **dict.fromkeys(PHOTO_SUFFIXES, ("photos.read_height_image", "picture")),
}


def read_height_map(path: str | Path, settings: MapSettings | None = None) -> HeightMap:
    """Read the height map in a file by its suffix, in mm, row 0 at the top. Raises FileError."""
    return read_part_map(path, settings).height_map


def read_part_map(
    path: str | Path, settings: MapSettings | None = None, *, most: int = MAX_PIXELS
) -> Surface:
    """Read the height map in a file, with its dirt; it may have `most` samples, checked from a header."""
    from pipeline.formats.grid import part_map
    from pipeline.formats.text_maps import is_number_table

    path, settings = Path(path), settings or MapSettings()
    reader = (READERS | _NAMED).get(path.suffix.lower())
    if reader is None:
        reader = TEXT_READER if is_number_table(path) else (INSTRUMENT_READER, "height map")
    name, kind = reader
    longest = min(MOST_BYTES["height_map"], most * BYTES_PER_SAMPLE + SPARE_BYTES)
    with reading(path, kind=kind, most_bytes=longest):
        module, _, function = name.partition(".")
        raw: RawMap = getattr(import_module(f"pipeline.formats.{module}"), function)(path, most)
    with naming(path):
        return part_map(raw, settings)


def read_scan(path: str | Path, *, most: int | None = None) -> Scan:
    """Read the scan in a recording. Raises FileError: it is damaged, too long (`most` samples), or has links."""
    import h5py

    from whisker_array.scan.recording import load_scan

    most_bytes = MOST_BYTES["scan"] if most is None else most * 16 + SPARE_BYTES
    with reading(Path(path), kind="HDF5", most_bytes=most_bytes):
        if not h5py.is_hdf5(path):
            raise DataError(
                "is not an HDF5 file", "record it again, or send a height map under its own suffix"
            )
        check_hdf5(Path(path), most=most)
        with hdf5_damage():
            return load_scan(path)
