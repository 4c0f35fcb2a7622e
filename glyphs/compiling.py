"""Show progress while kernels are compiled, once on a machine; light to import."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

BEGINS = "compiling kernels, once on this machine: about 15 s"
NOT_KEPT = "compiling kernels, about 15 s at every start: no folder for them can be written; set NUMBA_CACHE_DIR to one"


PROGRESS_S = 5.0
"""Seconds of compiling from one line about it to the next."""
LEAST_S = 1.0
"""Least seconds of compiling that are shown after the first kernels."""


class _Watch:
    """The listener, seconds of compiling since the last part, those shown already, and whether it was announced."""

    show: Callable[[str], None] | None = None
    at_it = False
    seconds = 0.0
    told_s = 0.0
    announced = False


@contextmanager
def show_compiling(show: Callable[[str], None]) -> Iterator[None]:
    """Show a line before the first kernels are compiled within the block, progress, and their time at a part's end."""
    before, _Watch.show = _Watch.show, show
    _Watch.at_it, _Watch.seconds = False, 0.0  # what was compiled unseen is no news
    _Watch.told_s, _Watch.announced = 0.0, False
    try:
        yield
    finally:
        end_part()
        _Watch.show = before


def report_start(*, kept: bool = True) -> None:
    """Show that a kernel is being compiled, because it is not in this machine's cache.

    Args:
        kept: whether it will be.
    """
    if not _Watch.announced and _Watch.show is not None:
        _Watch.show(BEGINS if kept else NOT_KEPT)
        _Watch.announced = True
        _Watch.told_s = -LEAST_S  # its end is shown however short it was
    _Watch.at_it = True


def report_end(seconds: float) -> None:
    """Show that a kernel has been compiled; another may follow."""
    _Watch.seconds += seconds
    if _Watch.show is not None and _Watch.seconds - max(_Watch.told_s, 0.0) >= PROGRESS_S:
        _Watch.show(f"compiling kernels: {_Watch.seconds:.0f} s so far")
        _Watch.told_s = _Watch.seconds


def end_part() -> None:
    """Show the time of all kernels compiled for a finished piece of work."""
    if _Watch.at_it and _Watch.show is not None and (_Watch.told_s or _Watch.seconds >= LEAST_S):
        _Watch.show(f"kernels compiled in {_Watch.seconds:.0f} s")
    _Watch.at_it, _Watch.seconds, _Watch.told_s = False, 0.0, 0.0
