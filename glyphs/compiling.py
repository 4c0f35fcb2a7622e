"""Who is shown that kernels are compiled, which happens once on a machine; light to import."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

BEGINS = "compiling kernels, once on this machine: about 15 s"
NOT_KEPT = "compiling kernels, about 15 s at every start: no folder for them can be written; set NUMBA_CACHE_DIR to one"


class _Watch:
    """Who watches, and for how long kernels have been compiled since the last part."""

    show: Callable[[str], None] | None = None
    at_it = False
    seconds = 0.0


@contextmanager
def compiling_shown(show: Callable[[str], None]) -> Iterator[None]:
    """Show a line before kernels are compiled within the block, and one when the part that needed them is done."""
    before, _Watch.show = _Watch.show, show
    _Watch.at_it, _Watch.seconds = False, 0.0  # what was compiled unseen is no news
    try:
        yield
    finally:
        part_done()
        _Watch.show = before


def compiling_begins(*, kept: bool = True) -> None:
    """Show that a kernel is compiled, for it is not on this machine's disk.

    Args:
        kept: whether it will be.
    """
    if not _Watch.at_it and _Watch.show is not None:
        _Watch.show(BEGINS if kept else NOT_KEPT)
    _Watch.at_it = True


def compiling_ends(seconds: float) -> None:
    """It is compiled; another may follow."""
    _Watch.seconds += seconds


def part_done() -> None:
    """A piece of work is done, and with it what was compiled for it."""
    if _Watch.at_it and _Watch.show is not None:
        _Watch.show(f"kernels compiled in {_Watch.seconds:.0f} s")
    _Watch.at_it, _Watch.seconds = False, 0.0
