"""Exit statuses, and expected failures as one line and a status."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from glyphs.errors import MarksError

FAILED = 1  # a part, file, store or machine failed
USAGE = 2  # an argument or setting cannot be used, or an extra is not installed
FAULT = 70  # a fault of the program, like EX_SOFTWARE of sysexits.h
INTERRUPTED = 130
BROKEN_PIPE = 141


class CommandError(MarksError):
    """A command cannot continue; with its exit status."""

    def __init__(self, what: str, *, hint: str = "", status: int = FAILED) -> None:
        super().__init__(what, hint=hint)
        self.status = status


class UsageError(CommandError):
    """Invalid arguments, or arguments that contradict each other."""

    def __init__(self, what: str, hint: str = "") -> None:
        super().__init__(what, hint=hint, status=USAGE)


_SERVICE = "fastapi uvicorn starlette sqlalchemy alembic structlog prometheus_client httpx"
_EXTRAS = {**dict.fromkeys(_SERVICE.split(), "service"), "ezdxf": "drawing"}
"""Libraries that only some commands need, and the extra that brings them."""


@contextlib.contextmanager
def failures_reported() -> Iterator[None]:
    """Turn expected failures into a CommandError: files and machines (status 1), settings, arguments and extras (2)."""
    try:
        yield
    except CommandError:
        raise
    except ModuleNotFoundError as error:
        raise UsageError(_missing(error)) from error
    except MarksError as error:
        raise CommandError(str(error), status=USAGE if error.is_usage else FAILED) from error


@contextlib.contextmanager
def resumable(output: str | Path | None, *, hint: str = "") -> Iterator[None]:
    """After an interrupt, say where finished parts are kept (CommandError), or the hint; None: nothing is kept."""
    try:
        yield
    except KeyboardInterrupt as error:
        if output is None:
            raise
        hint = hint or f"finished parts are kept in {output}, run the same command again to continue"
        raise CommandError("interrupted", hint=hint, status=INTERRUPTED) from error


def _missing(error: ModuleNotFoundError) -> str:
    from glyphs.errors import MissingExtraError

    library = (error.name or "").partition(".")[0]
    if library not in _EXTRAS:
        raise error
    return str(MissingExtraError("this command", library, _EXTRAS[library]))
