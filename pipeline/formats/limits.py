"""Size limits of files, checked from their headers before anything is decoded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from glyphs.hdf5_checks import n_values, own_datasets
from pipeline.errors import DataError, reading


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


def check_scan(path: Path, *, most: int) -> None:
    """Refuse a recording of too many samples, or one that points to other files.

    Raises:
        FileError: it is such a file, or no HDF5.
    """
    import h5py

    with reading(path, kind="HDF5", most_bytes=most * 16 + 64_000_000):
        if not h5py.is_hdf5(path):
            hint = "record it again, or send a height map under its own suffix"
            raise DataError("is not an HDF5 file", hint)
        check_hdf5(path, most=most)


def check_hdf5(path: Path, *, most: int) -> None:
    """Check that all that an HDF5 file holds is in it, and of bounded size; links are not followed.

    Raises:
        MarksError: it is not so.
    """
    import h5py

    with h5py.File(path, "r") as file:
        for dataset in own_datasets(file):
            count = n_values(dataset)
            # of a single whisker the stage's positions are twice as many as the samples
            if count > 2 * most or (dataset.name == "/scan/signal" and count > most):
                what = f"{dataset.name} holds {count:,} values, over the limit of {most:,}"
                raise DataError(what, "split the recording")
