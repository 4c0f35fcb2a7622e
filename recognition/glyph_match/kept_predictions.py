"""Predictions for fonts, cached on disk beside the compiled kernels, so that the next process need not compute them.

    outlines, die, touch or lamps, program --digest--> predicted-DIGEST.npz --there?--> arrays
                                                            '--no: predicted, and written--'

The least recently used files are removed. If nothing can be written, every process predicts its fonts.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.errors import FileError
from glyphs.kernel_cache import folder_of

MOST_BYTES = 200_000_000
"""Size limit of all files together: a font takes 8 MB by touch and 14 MB by camera."""

Arrays = Mapping[str, NDArray[Any]]


def load_or_predict(made_of: Iterable[object], make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of `make`, from the disk if they were made before of the same; the program counts, too."""
    folder = folder_of(load_or_predict)
    if folder is None:
        return make()
    path = folder / f"predicted-{_digest(made_of)}.npz"
    with contextlib.suppress(OSError, ValueError, EOFError, BadZipFile), np.load(path) as file:
        path.touch()
        return {name: file[name] for name in file.files}
    arrays: dict[str, Any] = dict(make())
    with contextlib.suppress(OSError, FileError):
        with replacing(path) as temporary:
            np.savez(temporary, **arrays)
        _remove_oldest(folder)
    return arrays


def _remove_oldest(folder: Path) -> None:
    files = sorted(
        (path.stat().st_mtime, path.stat().st_size, path) for path in folder.glob("predicted-*.npz")
    )
    spare = sum(size for _, size, _ in files) - MOST_BYTES
    for _, size, path in files:
        if spare <= 0:
            return
        path.unlink(missing_ok=True)
        spare -= size


def _digest(made_of: Iterable[object]) -> str:
    digest = sha256(_program())
    for value in made_of:
        _add(digest, value)
    return digest.hexdigest()[:32]


def _add(digest: Any, value: object) -> None:
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype} {value.shape} ".encode() + np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            _add(digest, getattr(value, field.name))
    elif isinstance(value, tuple):
        digest.update(f" {len(value)} ".encode())
        for item in value:
            _add(digest, item)
    else:
        text = repr(value).encode()
        digest.update(f" {len(text)} ".encode() + text)


@cache
def _program() -> bytes:
    digest, root = sha256(), Path(__file__).parents[2]
    for package in ("glyphs", "whisker_array", "recognition"):
        files = ((root / package).rglob(f"*.{kind}") for kind in ("py", "onnx"))
        for path in sorted(chain(*files)):
            about = path.stat()
            digest.update(f"{path.relative_to(root)} {about.st_size} {about.st_mtime_ns} ".encode())
    return digest.digest()
