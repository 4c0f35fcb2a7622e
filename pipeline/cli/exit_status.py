"""Exit statuses, and what a command may meet as one line and a status."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from glyphs.errors import FileError, MarksError

FAILED = 1
"""A part, file, store or machine failed."""
USAGE = 2
"""An argument or setting cannot be, or an extra is not installed."""
FAULT = 70
"""A fault of the program, as EX_SOFTWARE of sysexits.h."""
INTERRUPTED = 130
BROKEN_PIPE = 141


class CommandError(MarksError):
    """A command that cannot go on, and the status to leave with."""

    def __init__(self, what: str, *, hint: str = "", status: int = FAILED) -> None:
        super().__init__(what, hint=hint)
        self.status = status


_EXTRAS = {
    **dict.fromkeys(
        (
            "fastapi",
            "uvicorn",
            "starlette",
            "sqlalchemy",
            "alembic",
            "structlog",
            "prometheus_client",
            "httpx",
        ),
        "service",
    ),
    "ezdxf": "drawing",
}
"""Libraries that only some commands need, and the extra that brings them."""


@contextlib.contextmanager
def failures_reported() -> Iterator[None]:
    """Turn expected failures into a CommandError: files, stages (status 1), settings, arguments and extras (2).

    Whatever else is raised is a fault of the program and goes on to `pipeline.cli.main`.
    """
    from pipeline.formats.find_parts import NothingFoundError
    from whisker_array.scan.stage_error import StageError

    try:
        yield
    except CommandError:
        raise
    except (FileError, NothingFoundError, StageError) as error:
        raise CommandError(str(error), status=FAILED) from error
    except ModuleNotFoundError as error:
        raise CommandError(_missing(error), status=USAGE) from error
    except MarksError as error:
        raise CommandError(str(error), status=USAGE) from error


def _missing(error: ModuleNotFoundError) -> str:
    """What to install for a library that is not there.

    Raises:
        ModuleNotFoundError: the error itself, where no extra would bring it.
    """
    from glyphs.errors import MissingExtraError

    library = (error.name or "").partition(".")[0]
    if library not in _EXTRAS:
        raise error
    return str(MissingExtraError("this command", library, _EXTRAS[library]))
