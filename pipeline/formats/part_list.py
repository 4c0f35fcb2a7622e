"""Millions of listed parts in little memory: each is packed into bytes until it is asked for."""

from __future__ import annotations

import pickle
from array import array
from collections.abc import Iterable, Sequence
from typing import overload

from pipeline.formats.listed import ListedPart


class PartList(Sequence[ListedPart]):
    """Parts in their order, about 150 bytes each with names of usual length; `append` adds one."""

    def __init__(self, parts: Iterable[ListedPart] = ()) -> None:
        self._data = bytearray()
        self._ends = array("Q", [0])
        self._faulty: dict[int, ListedPart] = {}  # parts with a problem, as they are
        for part in parts:
            self.append(part)

    def append(self, part: ListedPart) -> None:
        """Add a part at the end."""
        if part.problem is None and part.photo_problem is None:
            self._data += pickle.dumps(
                tuple(getattr(part, name) for name in ListedPart.__slots__), protocol=5
            )
        else:
            self._faulty[len(self)] = part
        self._ends.append(len(self._data))

    def __len__(self) -> int:
        return len(self._ends) - 1

    @overload
    def __getitem__(self, at: int) -> ListedPart: ...

    @overload
    def __getitem__(self, at: slice) -> Sequence[ListedPart]: ...

    def __getitem__(self, at: int | slice) -> ListedPart | Sequence[ListedPart]:
        if isinstance(at, slice):
            return [self[k] for k in range(*at.indices(len(self)))]
        place = at + len(self) if at < 0 else at
        if not 0 <= place < len(self):
            raise IndexError(at)
        if place in self._faulty:
            return self._faulty[place]
        return ListedPart(*pickle.loads(self._data[self._ends[place] : self._ends[place + 1]]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]
