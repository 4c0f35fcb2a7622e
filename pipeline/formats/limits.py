"""Size limits of files, checked from their headers before anything is decoded."""

from __future__ import annotations

import contextlib
import re
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

from glyphs.errors import FileError, damage_reported, require_file
from glyphs.hdf5_checks import n_values, own_datasets

_MOST_XML_BYTES = 16_000_000
_MOST_MEMBERS = 10_000
_HEADER_BYTES = 10_000
_HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_HEAD_BYTES = 8192


@dataclass(frozen=True)
class Limits:
    """What a part may ask of the machine.

    Attributes:
        max_photo_pixels: of a photograph.
        max_map_samples: of a height map.
        max_scan_samples: of a recording, instants times channels.
        stage_field_mm: width and height that the stage can feel, where a photograph has no scale.
    """

    max_photo_pixels: int = 40_000_000
    max_map_samples: int = 30_000_000
    max_scan_samples: int = 60_000_000
    stage_field_mm: tuple[float, float] = (60.0, 25.0)


def check_photo(path: Path, *, most: int) -> None:
    """Refuse a photograph of too many pixels.

    Raises:
        FileError: it has more, is not a picture, or its head is damaged.
    """
    from pipeline.formats.photos import read_header

    read_header(path, most=most)


def check_map(path: Path, *, most: int) -> None:
    """Refuse a height map of too many samples; of formats but .npz, X3P and SDF their readers look at the head.

    Raises:
        FileError: it has more, or points to other files.
    """
    require_file(path, most_bytes=most * 24 + 64_000_000)
    with damage_reported(path, kind="height map"):
        if is_hdf5(path):
            check_hdf5(path, most=most)
        suffix = path.suffix.lower()
        shape: tuple[int, ...] | None = None
        if suffix == ".npz":
            shape = _npz_shape(path)
        elif suffix == ".x3p":
            shape = _x3p_shape(path)
        elif suffix == ".sdf":
            shape = _sdf_shape(path)
        if shape:
            count = 1
            for n in shape:
                count *= n
            _check(path, count, most, f"{' x '.join(f'{n:,}' for n in shape)} samples")


def check_scan(path: Path, *, most: int) -> None:
    """Refuse a recording of too many samples, or one that points to other files.

    Raises:
        FileError: it is such a file, or no HDF5.
    """
    require_file(path, most_bytes=most * 16 + 64_000_000)
    if not is_hdf5(path):
        raise FileError(
            path, "is not an HDF5 file", "record it again, or send a height map under its own suffix"
        )
    check_hdf5(path, most=most)


def is_hdf5(path: Path) -> bool:
    """Whether HDF5 begins here, or behind a block of the user's."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        at = 0
        while at < size:
            stream.seek(at)
            if stream.read(len(_HDF5_MAGIC)) == _HDF5_MAGIC:
                return True
            at = 512 if at == 0 else 2 * at
    return False


def check_hdf5(path: Path, *, most: int) -> None:
    """Check that all that an HDF5 file holds is in it, and of bounded size; links are not followed.

    Raises:
        FileError: it is not so.
    """
    import h5py

    with damage_reported(path, kind="HDF5"), h5py.File(path, "r") as file:
        for dataset in own_datasets(file):
            count = n_values(dataset)
            # of a single whisker the stage's positions are twice as many as the samples
            if count > 2 * most or (dataset.name == "/scan/signal" and count > most):
                raise FileError(
                    path,
                    f"{dataset.name} holds {count:,} values, over the limit of {most:,}",
                    "split the recording",
                )


def _check(path: Path, count: int, most: int, size: str) -> None:
    if count > most:
        raise FileError(path, f"has {size}, over the limit of {most:,}", "crop or thin it")


def _npz_shape(path: Path) -> tuple[int, ...] | None:
    """What the head of z_mm declares; None where there is none and the reader shall complain."""
    import numpy as np

    with zipfile.ZipFile(path) as archive:
        if len(archive.infolist()) > _MOST_MEMBERS:
            raise FileError(
                path, f"holds {len(archive.infolist()):,} members", "save z_mm and pitch_mm alone"
            )
        if "z_mm.npy" not in archive.namelist():
            return None
        with archive.open("z_mm.npy") as stream:
            version = np.lib.format.read_magic(stream)
            readers = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }
            if version not in readers:
                return None
            return tuple(readers[version](stream, max_header_size=_HEADER_BYTES)[0])


def _x3p_shape(path: Path) -> tuple[int, ...] | None:
    """What the description of an X3P file declares; None where the reader shall complain."""
    import x3pio

    from pipeline.formats.x3p import describe_x3p

    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist()[:_MOST_MEMBERS]:
            if member.filename.lower().endswith(".xml") and member.file_size > _MOST_XML_BYTES:
                raise FileError(path, f"unpacks to {member.file_size / 1e6:,.0f} MB", "export the map alone")
    with contextlib.suppress(x3pio.X3pFormatError):
        info, _ = describe_x3p(path)
        return (*(int(n) for n in info.shape), int(info.layer_count))
    return None


def _sdf_shape(path: Path) -> tuple[int, ...] | None:
    """What the head of an SDF file declares; None where the reader shall complain."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES).removeprefix(b"\xef\xbb\xbf")
    if head[:1].lower() == b"b":
        counts = struct.Struct("<II" if head[1:8] == b"ISO-2.0" else "<HH")
        return counts.unpack_from(head, 42) if len(head) >= 42 + counts.size else None
    found = [re.search(rb"(?i)" + n + rb"\s*=\s*(\d{1,12})", head) for n in (b"NumProfiles", b"NumPoints")]
    return tuple(int(m[1]) for m in found if m is not None)
