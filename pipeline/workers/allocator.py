"""How worker processes treat memory that comes and goes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

MALLOC = {"MALLOC_TRIM_THRESHOLD_": str(1 << 30), "MALLOC_MMAP_THRESHOLD_": str(1 << 30)}
"""Maps of tens of megabytes come and go; without this every one is given back to the system and cleared anew."""


@contextlib.contextmanager
def kept_memory() -> Iterator[None]:
    """Have processes that start meanwhile keep the memory they free, unless the user has set otherwise."""
    fresh = {name: value for name, value in MALLOC.items() if name not in os.environ}
    os.environ.update(fresh)
    try:
        yield
    finally:
        for name in fresh:
            os.environ.pop(name, None)
