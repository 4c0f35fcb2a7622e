"""Cache of compiled kernels on disk: numba's cache with a digest of each kernel; damaged ones are compiled again."""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core import caching, serialize
from numba.core.runtime.nrt import rtsys

# most of numba has no type hints
_Impl: Any = caching.CompileResultCacheImpl
_Cache: Any = caching.FunctionCache
_dumps: Any = serialize.dumps
_runtime: Any = rtsys


class _Sealed(_Impl):  # type: ignore[misc]
    def reduce(self, data: Any) -> tuple[bytes, bytes]:
        body: bytes = _dumps(super().reduce(data))
        return self._digest(body), body

    def rebuild(self, target_context: Any, reduced_data: Any) -> Any:
        digest, body = reduced_data
        if digest != self._digest(body):
            raise ValueError("a kernel on disk is damaged")
        return super().rebuild(target_context, pickle.loads(body))

    def _digest(self, body: bytes) -> bytes:
        # it covers the source, too: a full disk can leave an old kernel under a new index
        return sha256(self.locator.get_source_stamp() + body).digest()


class KernelCache(_Cache):  # type: ignore[misc]
    """Cache of one function's kernels; loading and saving never raise."""

    _impl_class = _Sealed

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            # enough to run a cached kernel; numba would also import its compiler here, which takes 0.3 s
            _runtime.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception:  # damage can raise anything; whatever it is, the kernel is compiled again
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):
            try:
                super().save_overload(sig, data)
            except OSError:
                raise
            except Exception:  # a damaged index: begin a new one
                self.flush()
                super().save_overload(sig, data)


def cache_of(function: Callable[..., Any]) -> Any:
    """Create the cache of a function's kernels in NUMBA_CACHE_DIR, beside its module, in the user's folder, or none."""
    try:
        return KernelCache(function)
    except (RuntimeError, OSError):  # numba found no folder
        return caching.NullCache()


def folder_of(function: Callable[..., Any]) -> Path | None:
    """Return the folder of `cache_of`, created if needed; None if there is no cache."""
    try:
        locator = _Sealed(function).locator
        locator.ensure_cache_path()
        return Path(locator.get_cache_path())
    except (RuntimeError, OSError):
        return None


def first_on_this_machine() -> bool:
    """Whether this is the first process that compiles for its cache; true only once, for one of several processes."""
    folder = folder_of(cache_of)
    if folder is None:
        return True
    try:
        (folder / "kernels-compiled").touch(exist_ok=False)
    except OSError:
        return False
    return True
