"""What a part is taken through, as it happens, for a person who waits for it."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def steps_shown(show: Callable[[str], None]) -> Iterator[None]:
    """Call `show` with every step that recognition logs in this process, such as "trying font 3 of 5"."""

    class Logged(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            show(record.getMessage())

    logger, handler = logging.getLogger("recognition"), Logged(logging.DEBUG)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
