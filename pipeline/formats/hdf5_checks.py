"""Check that all content of an HDF5 file is inside it and of bounded size, without decoding or following links: through
external links, external storage or virtual datasets a stranger's file could read the server's."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError

# a recording has some thirty groups and datasets
MOST_OBJECTS = 10_000
# of nested groups
MOST_DEPTH = 16
# a chunk of a dataset is unpacked whole, however little of it is read
MOST_CHUNK_BYTES = 268_435_456
# HDF5 makes an object for each chunk, even for those that were never written
MOST_CHUNKS = 50_000


@contextlib.contextmanager
def hdf5_damage() -> Iterator[None]:
    """Report an error of the HDF5 library that is not the system's as damage, without the library's own words."""
    try:
        yield
    except OSError as error:
        if error.errno:
            raise
        raise MarksError("is damaged or cut short", hint="copy it again") from error


def check_hdf5(path: Path, *, most: int | None) -> None:
    """Check an HDF5 file and its chunks. Raises MarksError: a check fails. Its signal may hold `most` values, another
    dataset twice as many; without `most` only objects and chunks are checked."""
    import h5py

    links: dict[str, Any] = {}

    def see(name: str, link: Any) -> MarksError | None:
        links[name] = link
        if len(links) > MOST_OBJECTS or name.count("/") >= MOST_DEPTH:
            what = f"holds more than {MOST_OBJECTS:,} groups or nests them deeper than {MOST_DEPTH}"
            return MarksError(what, hint="write it again with tactile-marks")
        if most is not None and isinstance(link, h5py.ExternalLink):
            return MarksError(f"has a link into another file (/{name})", hint="copy the data into it")
        return None

    with hdf5_damage(), h5py.File(path, "r") as file:
        if (problem := file.visititems_links(see)) is not None:
            raise problem
        for name, link in links.items():
            # a soft link's target lies in the file and is visited on its own
            if isinstance(link, h5py.HardLink) and isinstance(dataset := file[name], h5py.Dataset):
                _check_dataset(dataset, most)


def _check_dataset(dataset: Any, most: int | None) -> None:
    import h5py

    creation = dataset.id.get_create_plist()
    layout = creation.get_layout()
    if most is not None:
        if layout == h5py.h5d.VIRTUAL or creation.get_external_count():
            raise MarksError(f"keeps {dataset.name} in another file", hint="copy the data into this one")
        count = math.prod(map(int, dataset.id.shape or ()))
        # with a single whisker there are twice as many stage positions (x and y) as samples
        if count > (most if dataset.name == "/scan/signal" else 2 * most):
            what = f"{dataset.name} holds {count:,} values, over the limit of {most:,}"
            raise MarksError(what, hint="split the recording")
    if layout == h5py.h5d.CHUNKED:
        sides = [int(side) for side in creation.get_chunk()]
        chunks = math.prod(-(-int(n) // side) for n, side in zip(dataset.id.shape, sides, strict=True))
        if chunks > MOST_CHUNKS:
            raise MarksError(f"{dataset.name} has {chunks:,} chunks", hint="write it in larger chunks")
        chunk = math.prod(sides) * dataset.id.get_type().get_size()
        if chunk > MOST_CHUNK_BYTES:
            hint = "write it in smaller chunks"
            raise MarksError(f"{dataset.name} has chunks of {chunk / 1e6:,.0f} MB", hint=hint)
