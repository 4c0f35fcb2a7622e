"""An open HDF5 file whose names, shapes, sizes and numbers are checked before they are used."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, MarksError
from whisker_array.arrays import Floats

SEE_LAYOUT = "see docs/pages/reference/recordings.md for the layout"
MAX_SAMPLES = 200_000_000
"""Largest number of values (instants x channels) read: 0.8 GB as float32."""
_MOST_PACKED = 1100
"""Greatest possible ratio of unpacked to packed length in a deflate stream; beyond it, data is missing."""
Shape = tuple[int | None, ...]


class CheckedFile:
    """One open file; every error names it."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self.file = file

    def fail(self, what: str, hint: str = SEE_LAYOUT) -> FileError:
        return FileError(self.path, what, hint)

    def require(self, right: bool | np.bool_, what: str, hint: str = SEE_LAYOUT) -> None:
        if not right:
            raise self.fail(what, hint)

    @contextmanager
    def naming(self, what: str = "", *, hint: str = "") -> Iterator[None]:
        """Turn a MarksError of the block into a FileError about this file, which begins with `what`."""
        try:
            yield
        except FileError:
            raise
        except MarksError as error:
            raise self.fail(what + error.what, hint or error.hint or SEE_LAYOUT) from error

    def dataset(
        self, name: str, shape: Shape, *, kinds: str = "fiu", most: int = MAX_SAMPLES
    ) -> h5py.Dataset:
        """Find a dataset of numbers of a shape (None: any length). Raises FileError."""
        item = self.file.get(name)
        if not isinstance(item, h5py.Dataset):
            raise self.fail(f"has no dataset /{name}")
        numbers = "numbers" if "f" in kinds else "whole numbers"
        self.require(item.dtype.kind in kinds, f"/{name} is of type {item.dtype}, not {numbers}")
        actual = item.shape or ()
        alike = len(actual) == len(shape) and all(
            n in (None, have) for n, have in zip(shape, actual, strict=True)
        )
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        self.require(alike, f"/{name} has shape {item.shape}, not {wanted}")
        self.require(item.size > 0, f"/{name} is empty", "record at least one pass")
        over = f"/{name} holds {item.size:,} values, over the limit of {most:,}"
        self.require(item.size <= most, over, "split the scan")
        elsewhere = item.is_virtual or item.external
        self.require(not elsewhere, f"/{name} keeps its data in another file", "copy the data into this one")
        written = item.nbytes <= _MOST_PACKED * item.id.get_storage_size()
        self.require(
            written, f"/{name} declares data that was never written", "let the recording end properly"
        )
        return item

    def numbers(
        self, name: str, shape: Shape, *, most: int = MAX_SAMPLES, default: float | None = None
    ) -> Floats:
        """Read a dataset as finite numbers; a missing one is filled with the default, if there is one."""
        if default is not None and name not in self.file:
            return np.full([n or 0 for n in shape], default, dtype=np.float64)
        values = np.asarray(self.dataset(name, shape, most=most)[()], dtype=np.float64)
        finite = np.isfinite(values).all() or not (default is None or np.isfinite(default))
        self.require(finite, f"/{name} has values that are not finite")
        return values

    def integers(self, name: str, n_rows: int, *, default: int | None = None) -> NDArray[np.integer[Any]]:
        """Read a dataset as whole numbers, one for each row; a missing one is filled with the default."""
        if default is not None and name not in self.file:
            return np.full(n_rows, default)
        return np.asarray(self.dataset(name, (n_rows,), kinds="iu")[()])

    def attribute(self, name: str, default: float | None = None, *, group: str = "/") -> float:
        value = self.file[group].attrs.get(name, default)
        if value is None:
            raise self.fail(f"has no attribute {name}")
        try:
            number = float(value)
        except (TypeError, ValueError) as error:
            raise self.fail(f"attribute {name} is {value!r}, not a number") from error
        self.require(np.isfinite(number), f"attribute {name} is {number}")
        return number

    def text(self, name: str, default: str = "", *, group: str = "/") -> str:
        value = self.file[group].attrs.get(name, default)
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
