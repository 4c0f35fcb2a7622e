"""What a command may meet, as one line and a status."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from pipeline.cli import FAILED, USAGE, CommandError


@contextlib.contextmanager
def failures_told() -> Iterator[None]:
    """Turn what a person can mend into a CommandError: files (status 1), settings and arguments (2)."""
    from pipeline.parts import NothingFoundError
    from pipeline.problems import FileProblem
    from pipeline.settings import SettingsError

    try:
        yield
    except (FileProblem, NothingFoundError) as error:
        raise CommandError(str(error), status=FAILED) from error
    except (SettingsError, ValueError) as error:
        raise CommandError(str(error), status=USAGE) from error
