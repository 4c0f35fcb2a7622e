"""Logs as lines of JSON, or of text for a person; every line of a request bears its id."""

from __future__ import annotations

import logging
import sys
from typing import Any, Literal

import structlog


def set_up_logs(form: Literal["json", "text"] = "json") -> None:
    """Send the service's log and that of its libraries to standard error, in one form."""
    shared: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    structlog.configure(
        processors=[
            *shared,
            structlog.processors.format_exc_info,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )
    last = (
        structlog.processors.JSONRenderer(ensure_ascii=False)
        if form == "json"
        else structlog.dev.ConsoleRenderer(
            colors=sys.stderr.isatty(),
            # with the values of all names it took half a minute, in which nobody was answered
            exception_formatter=structlog.dev.plain_traceback,
        )
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[
                *shared,
                structlog.stdlib.add_logger_name,
                structlog.processors.format_exc_info,
            ],
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, last],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.INFO)
    for noisy in ("asyncua", "uvicorn.access", "httpx", "httpcore", "alembic", "RapidOCR"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
    for taken in ("uvicorn", "uvicorn.error"):
        logging.getLogger(taken).handlers.clear()
        logging.getLogger(taken).propagate = True
