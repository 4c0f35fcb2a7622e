"""Show progress while kernels are compiled, once on a machine; light to import."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

COMPILE_ONCE = "compiling kernels, once on this machine: about 15 s"
COMPILE_EVERY_RUN = (
    "compiling kernels, about 15 s at every start: no cache folder is writable; set NUMBA_CACHE_DIR to one"
)

PROGRESS_S = 5.0
"""Seconds of compiling between two progress messages."""


class _Watch:
    show: Callable[[str], None] | None = None
    compiled = False
    seconds = 0.0
    shown_s = 0.0
    announced = False


@contextmanager
def show_compiling(show: Callable[[str], None]) -> Iterator[None]:
    """Within the block, show the start of compiling, its progress, and its time at the end of each part."""
    before, _Watch.show = _Watch.show, show
    _Watch.compiled, _Watch.seconds = False, 0.0  # do not count what was compiled before the block
    _Watch.shown_s, _Watch.announced = 0.0, False
    try:
        yield
    finally:
        end_part()
        _Watch.show = before


def report_start(*, cached: bool = True, first: Callable[[], bool] = lambda: True) -> None:
    """Show that a kernel is being compiled; after the `first` on a machine, only long compilations are shown."""
    if not _Watch.announced and _Watch.show is not None:
        _Watch.announced = True
        if not cached or first():
            _Watch.show(COMPILE_ONCE if cached else COMPILE_EVERY_RUN)
            _Watch.shown_s = -PROGRESS_S  # the end is shown, too, however soon it comes
    _Watch.compiled = True


def report_end(seconds: float) -> None:
    """Show that a kernel has been compiled; another may follow."""
    _Watch.seconds += seconds
    if _Watch.show is not None and _Watch.seconds - max(_Watch.shown_s, 0.0) >= PROGRESS_S:
        _Watch.show(f"compiling kernels: {_Watch.seconds:.0f} s so far")
        _Watch.shown_s = _Watch.seconds


def end_part() -> None:
    """Show the compiling time of a finished part of the work."""
    if _Watch.compiled and _Watch.show is not None and _Watch.shown_s:
        _Watch.show(f"kernels compiled in {_Watch.seconds:.0f} s")
    _Watch.compiled, _Watch.seconds, _Watch.shown_s = False, 0.0, 0.0
