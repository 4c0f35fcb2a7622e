"""Edits of HDF5 files, to see what their readers say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np

Edit = Callable[[h5py.File], object]


def put(name: str, values: Any) -> Edit:
    """A dataset with other values, in place of the one there is."""

    def change(file: h5py.File) -> None:
        drop(name)(file)
        file[name] = values

    return change


def drop(*names: str) -> Edit:
    """Datasets and groups left out, those that are there."""

    def change(file: h5py.File) -> None:
        for name in names:
            if name in file:
                del file[name]

    return change


def unwritten(name: str, shape: tuple[int, ...], **how: Any) -> Edit:
    """A dataset of single precision of which nothing is written, in place of the one there is."""

    def change(file: h5py.File) -> None:
        drop(name)(file)
        file.create_dataset(name, shape, np.float32, **how)

    return change


def fill(name: str, value: float) -> Edit:
    """One value all over a dataset."""
    return lambda file: file[name].__setitem__(..., value)


def attribute(name: str, value: Any, group: str = "/") -> Edit:
    """An attribute with another value."""
    return lambda file: file[group].attrs.__setitem__(name, value)
