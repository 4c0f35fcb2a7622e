"""Keep an interrupt from being lost: a KeyboardInterrupt in a destructor is printed and forgotten. It is therefore also
recorded, and raised again at the next outcome of a task."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SEEN = threading.Event()


@contextmanager
def interrupts_noted() -> Iterator[None]:
    """Record interrupts within the block; only the main thread receives them."""
    _SEEN.clear()
    ours = threading.current_thread() is threading.main_thread()
    ours = ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if _SEEN.is_set():
            # the interpreter remembers an interrupt of a string that it was executing, as when a dataclass or named
            # tuple is made, until it executes another: `python -m` would end by the signal, not with our status
            exec("")


def raise_interrupt() -> None:
    """Raise a KeyboardInterrupt that was recorded."""
    if _SEEN.is_set():
        raise KeyboardInterrupt


def _note(number: int, frame: FrameType | None) -> None:
    _SEEN.set()
    signal.default_int_handler(number, frame)
