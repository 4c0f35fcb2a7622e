"""Who is shown that kernels are compiled, which happens once on a machine; light to import."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

BEGINS = "compiling kernels, once on this machine: about 15 s"


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


def compiling_begins() -> None:
    """A kernel is not on this machine's disk yet and is compiled now."""
    if not _Watch.at_it and _Watch.show is not None:
        _Watch.show(BEGINS)
    _Watch.at_it = True


def compiling_ends(seconds: float) -> None:
    """It is compiled; another may follow."""
    _Watch.seconds += seconds


def part_done() -> None:
    """A piece of work is done, and with it what was compiled for it."""
    if _Watch.at_it and _Watch.show is not None:
        _Watch.show(f"kernels compiled in {_Watch.seconds:.0f} s")
    _Watch.at_it, _Watch.seconds = False, 0.0
