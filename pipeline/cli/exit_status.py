"""Exit statuses, and what a command may meet as one line and a status."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

FAILED = 1
USAGE = 2
INTERRUPTED = 130
BROKEN_PIPE = 141


class CommandError(Exception):
    """A command that cannot go on: one line for the person, and the status to leave with."""

    def __init__(self, message: str, *, status: int = FAILED) -> None:
        super().__init__(message)
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
    "jinja2": "report",
}
"""Libraries that only some commands need, and the extra that brings them."""


@contextlib.contextmanager
def failures_told() -> Iterator[None]:
    """Turn what a person can mend into a CommandError: files (status 1), settings, arguments and extras (2)."""
    from pipeline.common.errors import FileProblem
    from pipeline.common.settings import SettingsError
    from pipeline.files.parts import NothingFoundError

    try:
        yield
    except (FileProblem, NothingFoundError) as error:
        raise CommandError(str(error), status=FAILED) from error
    except ModuleNotFoundError as error:
        raise CommandError(_missing(error), status=USAGE) from error
    except (SettingsError, ValueError) as error:
        raise CommandError(str(error), status=USAGE) from error


def _missing(error: ModuleNotFoundError) -> str:
    """What to install for a library that is not there.

    Raises:
        ModuleNotFoundError: the error itself, where no extra would bring it.
    """
    from pipeline.common.missing_extra import MissingExtraError

    if isinstance(error, MissingExtraError):
        return str(error)
    library = (error.name or "").partition(".")[0]
    if library not in _EXTRAS:
        raise error
    return str(MissingExtraError("this command", library, _EXTRAS[library]))
