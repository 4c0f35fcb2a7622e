"""Points in a PCD file (Point Cloud Library), ASCII or binary."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError

_MOST_HEAD_BYTES = 20_000
_KINDS = {"F": "f", "I": "i", "U": "u"}


def read_pcd(path: Path) -> NDArray[np.float64]:
    """Points (n, 3) of a PCD file.

    Raises:
        FileError: no x, y and z, compressed, or cut short.
    """
    data = path.read_bytes()
    mark = data.find(b"\nDATA ", 0, _MOST_HEAD_BYTES) + 1
    end = data.find(b"\n", mark) + 1
    if not mark or not end:
        raise FileError(path, "is damaged or not a PCD file (it has no line DATA)", "copy or export it again")
    head = {}
    for line in data[:end].decode("ascii", "replace").splitlines():
        key, *values = line.split() or [""]
        head[key] = values
    names, form = head["FIELDS"], head["DATA"][0]
    counts = [int(n) for n in head.get("COUNT", ["1"] * len(names))]
    if not {"x", "y", "z"} <= set(names):
        raise FileError(path, f"has the fields {' '.join(names)[:80]}", "export x, y and z")
    if form == "binary":
        kinds = [(str(k), f"<{_KINDS[kind]}{size}", n) for k, (kind, size, n) in
                 enumerate(zip(head["TYPE"], head["SIZE"], counts, strict=True))]  # fmt: skip
        rows = np.frombuffer(data, np.dtype(kinds), count=int(head["POINTS"][0]), offset=end)
        return np.stack(
            [rows[str(names.index(axis))].reshape(len(rows), -1)[:, 0] for axis in "xyz"],
            axis=1,
            dtype=np.float64,
        )
    if form == "ascii":
        columns = [sum(counts[: names.index(axis)]) for axis in "xyz"]
        return np.loadtxt(io.BytesIO(data[end:]), usecols=columns, ndmin=2)
    raise FileError(
        path, f"holds its points as {form}", "save it as ASCII or binary PCD, as PLY or as columns x y z"
    )
