"""An open HDF5 file whose names, shapes, sizes and numbers are checked before they are used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError

SEE_LAYOUT = "see docs/pages/reference/recordings.md for the layout"
MAX_SAMPLES = 200_000_000
"""Largest number of values (instants x channels) read: 0.8 GB as float32."""
_MOST_PACKED = 1100
"""No deflate stream unpacks to more times its length than this: more is declared, but was never written."""


def text_attribute(attributes: Any, name: str, default: str) -> str:
    """An attribute as text, whichever way the writer stored it."""
    value = attributes.get(name, default)
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


class CheckedFile:
    """One open file; every error names it."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self.file = file

    def fail(self, what: str, hint: str = SEE_LAYOUT) -> FileError:
        """The error for this file."""
        return FileError(self.path, what, hint)

    def dataset(self, name: str, shape: tuple[int | None, ...]) -> h5py.Dataset:
        """The dataset, checked: numbers of this shape (None: any length), really in the file."""
        found = self.file.get(name)
        if not isinstance(found, h5py.Dataset):
            raise self.fail(f"has no dataset /{name}")
        if found.dtype.kind not in "fiu":
            raise self.fail(f"/{name} is of type {found.dtype}, not numbers")
        actual = found.shape
        fits = actual is not None and len(actual) == len(shape)
        if not fits or any(
            want is not None and want != have for want, have in zip(shape, actual, strict=True)
        ):
            wanted = " x ".join("any" if n is None else str(n) for n in shape)
            raise self.fail(f"/{name} has shape {actual}, not {wanted}")
        if found.size == 0:
            raise self.fail(f"/{name} is empty", "record at least one pass")
        if found.size > MAX_SAMPLES:
            raise self.fail(
                f"/{name} holds {found.size:,} values, over the limit of {MAX_SAMPLES:,}", "split it"
            )
        if found.is_virtual or found.external:
            raise self.fail(f"/{name} keeps its data in another file", "copy the data into this one")
        if found.nbytes > _MOST_PACKED * found.id.get_storage_size():
            raise self.fail(f"/{name} declares data that was never written", "let the recording end properly")
        return found

    def numbers(
        self, name: str, shape: tuple[int | None, ...], *, most: int = MAX_SAMPLES
    ) -> NDArray[np.float64]:
        """The dataset as finite numbers, at most so many."""
        dataset = self.dataset(name, shape)
        if dataset.size > most:
            raise self.fail(
                f"/{name} holds {dataset.size:,} values, over the limit of {most:,}", "split the scan"
            )
        values = np.asarray(dataset[()], dtype=np.float64)
        if not np.isfinite(values).all():
            raise self.fail(f"/{name} has values that are not finite")
        return values

    def attribute(self, attributes: Any, name: str, default: float | None = None) -> float:
        """An attribute as a finite number."""
        value = attributes.get(name, default)
        if value is None:
            raise self.fail(f"has no attribute {name}")
        try:
            number = float(value)
        except (TypeError, ValueError) as error:
            raise self.fail(f"attribute {name} is {value!r}, not a number") from error
        if not np.isfinite(number):
            raise self.fail(f"attribute {name} is {number}")
        return number

    def integers(self, name: str, n_rows: int) -> NDArray[np.integer[Any]]:
        """The dataset as whole numbers, one for each row."""
        dataset = self.dataset(name, (n_rows,))
        if dataset.dtype.kind not in "iu":
            raise self.fail(f"/{name} is of type {dataset.dtype}, not whole numbers")
        return np.asarray(dataset[()])
