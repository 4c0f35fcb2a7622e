"""What a part is taken through, as it happens, for a person who waits for it."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def steps_shown(show: Callable[[str], None]) -> Iterator[None]:
    """Call `show` with every step of this process: kernels that are compiled, and what recognition logs.

    Args:
        show: called with a few words; with none where a kernel is compiled and nothing was logged before.
    """
    from numba.core import event

    logged = ""

    class Compiling(event.Listener):
        def on_start(self, _: object) -> None:
            show("compiling, once per machine")

        def on_end(self, _: object) -> None:
            show(logged)

    class Logged(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            nonlocal logged
            logged = record.getMessage()
            show(logged)

    logger, handler = logging.getLogger("recognition"), Logged(logging.DEBUG)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        with event.install_listener("numba:compile", Compiling()):
            yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
