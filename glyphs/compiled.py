"""Kernels: loops that numba compiles at their first call and caches on disk.

The first reading on a machine waits for all kernels to be compiled, which takes at least 0.1 s each, so they are kept
small:

- array arguments are contiguous and always of the same type, so that there is one specialisation; work arrays are
  arguments, too;
- they index rows and elements: a slice takes as long to compile as half a kernel, an assigned slice as long as two;
- numpy does everything but the loops, before and after the kernel;
- no `parallel=True`, which takes seven times as long to compile: kernels release the GIL, and threads share the rows;
- few sets of fast-math flags, because numba compiles `max` and similar functions again for each.
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
from glyphs.kernel_cache import cache_of, first_on_this_machine

Function: TypeAlias = Callable[..., Any]

ANY_ORDER = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Allow sums in any order, so that they are vectorised; NaN are respected."""
FAST = frozenset({"fast"})
"""Allow all relaxations; there must be no NaN."""


def kernel(*, allow: frozenset[str] = frozenset()) -> Callable[[Function], Function]:
    """Return a decorator that compiles a function; `allow`: its fast-math flags. Division by zero gives inf."""

    def decorate(function: Function) -> Function:
        dispatcher: Any = njit(error_model="numpy", nogil=True, fastmath=set(allow) if allow else False)(
            function
        )
        # in place of njit(cache=True), which fails on damaged files, full disks and read-only folders
        dispatcher._cache = cache_of(function)
        _Compiling.all_cached &= not isinstance(dispatcher._cache, NullCache)
        return dispatcher  # type: ignore[no-any-return]

    return decorate


def inline_kernel(function: Function) -> Function:
    """Inline a function in the kernels that call it, with their fast-math flags."""
    compiled: Function = njit(error_model="numpy", inline="always")(function)
    return compiled


def read_only(array: NDArray[Any], dtype: DTypeLike | None = None) -> NDArray[Any]:
    """Return a contiguous read-only view; numba compiles writable and read-only arrays as two types."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view


class _Compiling(event.Listener):  # type: ignore[misc,unused-ignore]
    all_cached = True
    """Whether every kernel has a cache on disk."""

    def __init__(self) -> None:
        self._began_s: list[float] = []

    def on_start(self, event: Any) -> None:
        self._began_s.append(time.monotonic())
        if len(self._began_s) == 1:
            report_start(cached=self.all_cached, first=first_on_this_machine)

    def on_end(self, event: Any) -> None:
        began_s = self._began_s.pop()
        if not self._began_s:
            report_end(time.monotonic() - began_s)


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call,unused-ignore]
