"""Kernels: loops that numba compiles at their first call and caches on disk.

The first reading on a machine waits for all kernels to be compiled, a tenth of a second for the least of them, so
they are lean:

- arrays come in contiguous and of one type each, so that there is one specialisation; room to work in comes in, too;
- they look at rows and elements: a slice costs as much as half a kernel, a slice assigned to more than two;
- what is no loop is done before and after, by numpy;
- no `parallel=True`, which costs seven times as much: kernels let go of Python's lock, and threads share their rows;
- a few kinds of arithmetic only, because numba compiles `max` and its like for each kind anew.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numba.core import event
from numba.core.caching import NullCache
from numpy.typing import DTypeLike, NDArray

from glyphs.compiling import report_end, report_start
from glyphs.kernel_cache import cache_of

Function: TypeAlias = Callable[..., Any]

ANY_ORDER = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Sums in any order, so that they run in vectors; NaN keep their meaning."""
CONTRACTED = frozenset({"contract"})
"""Products and sums in one step, rounded once."""
FAST = frozenset({"fast"})
"""All relaxations, as if there were no NaN."""


def kernel(*, allow: frozenset[str] = frozenset()) -> Callable[[Function], Function]:
    """Make a decorator that compiles a function; `allow`: relaxations of its arithmetic. Division by zero gives inf."""

    def made(function: Function) -> Function:
        dispatcher: Any = njit(error_model="numpy", nogil=True, fastmath=set(allow) if allow else False)(
            function
        )
        # in place of njit(cache=True), whose files may be damaged, full or not to be written
        dispatcher._cache = cache_of(function)
        kept = not isinstance(dispatcher._cache, NullCache)
        _Compiling.kept = _Compiling.kept and kept
        return dispatcher  # type: ignore[no-any-return]

    return made


def inline_kernel(function: Function) -> Function:
    """Inline a function in the kernels that call it, with their arithmetic."""
    made: Function = njit(error_model="numpy", inline="always")(function)
    return made


def read_only(array: NDArray[Any], dtype: DTypeLike | None = None) -> NDArray[Any]:
    """Return a contiguous read-only view of an array with a given dtype.

    For numba what can be written to and what cannot are two types: so there is one.
    """
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view


class _Compiling(event.Listener):  # type: ignore[misc,unused-ignore]
    """Reports when numba compiles, which it does under its lock, one kernel within another."""

    kept = True
    """Whether there is a folder to keep kernels in."""

    def __init__(self) -> None:
        self._began_s: list[float] = []

    def on_start(self, event: Any) -> None:
        self._began_s.append(time.monotonic())
        if len(self._began_s) == 1:
            report_start(kept=self.kept)

    def on_end(self, event: Any) -> None:
        began_s = self._began_s.pop()
        if not self._began_s:
            report_end(time.monotonic() - began_s)


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call,unused-ignore]
