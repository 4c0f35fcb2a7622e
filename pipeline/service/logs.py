"""Logs as lines of JSON or text; every line of a request contains its id."""

from __future__ import annotations

import logging
import os
import sys
from typing import Any, Literal

import structlog


def set_up_logs(form: Literal["json", "text"] = "json") -> None:
    """Send the service's log and that of its libraries to standard error, in one form."""
    processors, formatter = structlog.processors, structlog.stdlib.ProcessorFormatter
    shared: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        processors.TimeStamper(fmt="iso", utc=True),
    ]
    structlog.configure(
        processors=[*shared, processors.format_exc_info, formatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )
    last: Any = processors.JSONRenderer(ensure_ascii=False)
    if form == "text":
        # a traceback with the values of all names took half a minute, during which no request was answered
        plain = structlog.dev.plain_traceback
        last = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=plain)
    # in a stream of its own: the command gives its streams up when they fail, and a full disk may have room again
    stream = open(os.dup(sys.stderr.fileno()), "w", 1, encoding="utf-8", errors="backslashreplace")  # noqa: SIM115
    logging.raiseExceptions = False  # a line that cannot be written is left out
    handler = logging.StreamHandler(stream)
    foreign = [*shared, structlog.stdlib.add_logger_name, processors.format_exc_info]
    handler.setFormatter(
        formatter(foreign_pre_chain=foreign, processors=[formatter.remove_processors_meta, last])
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.INFO)
    for noisy in ("asyncua", "uvicorn.access", "httpx", "httpcore", "alembic", "RapidOCR"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
    for logger in map(logging.getLogger, ("uvicorn", "uvicorn.error")):
        logger.handlers.clear()
        logger.propagate = True
