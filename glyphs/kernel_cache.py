"""Cache of compiled kernels on disk: numba's cache with a digest of each kernel; damaged files are ignored.

The files are derived data: what is damaged is thrown away and compiled again, and where nothing can be written the
kernels are compiled at every start.
"""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core import caching, serialize
from numba.core.runtime.nrt import rtsys

# numba has types for few of its functions
_Impl: Any = caching.CompileResultCacheImpl
_Cache: Any = caching.FunctionCache
_dumps: Any = serialize.dumps
_runtime: Any = rtsys


class _Sealed(_Impl):  # type: ignore[misc]
    """Kernels with digests of their bytes and source, because damaged machine code would crash the process."""

    def reduce(self, data: Any) -> tuple[bytes, bytes]:
        body: bytes = _dumps(super().reduce(data))
        return self._digest(body), body

    def rebuild(self, target_context: Any, reduced_data: Any) -> Any:
        digest, body = reduced_data
        if digest != self._digest(body):
            raise ValueError("a kernel on disk is damaged")
        return super().rebuild(target_context, pickle.loads(body))

    def _digest(self, body: bytes) -> bytes:
        # of the source, too: a full disk can leave an old kernel under a new index
        return sha256(self.locator.get_source_stamp() + body).digest()


class KernelCache(_Cache):  # type: ignore[misc]
    """The kernels of one function; neither loading nor saving ever fails."""

    _impl_class = _Sealed

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the kernel of a signature; None if it is missing or damaged."""
        try:
            # all that a kernel on disk calls; numba would import here what compiling needs, for a third of a second
            _runtime.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception:  # damage can raise anything; whatever it is, the kernel is compiled again
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a kernel, if there is room for it."""
        with contextlib.suppress(OSError):
            try:
                super().save_overload(sig, data)
            except OSError:
                raise
            except Exception:  # a damaged index: begin a new one
                self.flush()
                super().save_overload(sig, data)


def cache_of(function: Callable[..., Any]) -> Any:
    """Make the cache of a function's kernels: NUMBA_CACHE_DIR, beside its module, or the user's own cache; no cache if
    no such folder can be written."""
    try:
        return KernelCache(function)
    except (RuntimeError, OSError):  # numba found no folder
        return caching.NullCache()


def folder_of(function: Callable[..., Any]) -> Path | None:
    """Folder of `cache_of` for the kernels of a function, created if needed; None without one."""
    try:
        locator = _Sealed(function).locator
        locator.ensure_cache_path()
        return Path(locator.get_cache_path())
    except (RuntimeError, OSError):
        return None
