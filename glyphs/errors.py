"""Errors that a user can mend: wrong input, settings, files, machines. Anything else is a fault of the program."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from glyphs.plain_text import visible


class MarksError(Exception):
    """An expected failure, with a message for the user.

    Its text is one line, "where: what; hint". It can be pickled as long as every keyword argument of a class
    derived from it has a default.

    Attributes:
        what: what is wrong.
        where: file, setting or place that it is wrong with; empty where the message says it.
        hint: what to do about it; empty where nothing can be said.
    """

    def __init__(self, what: str, *, where: str = "", hint: str = "") -> None:
        # BaseException.__new__ has kept the positional arguments, which is what pickling calls the class with
        self.what, self.where, self.hint = what, where, hint

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        todo = f"; {self.hint}" if self.hint else ""
        return visible(" ".join(f"{place}{self.what}{todo}".split()))


class FileError(MarksError):
    """A file that cannot be used.

    Attributes:
        path: the file.
    """

    def __init__(self, path: str | Path, what: str, hint: str) -> None:
        super().__init__(what, where=str(path), hint=hint)
        self.path = Path(path)


class FaultError(FileError):
    """A fault of the program, met while it was at work on a file: nothing is wrong with the file."""


class OwnFileError(FileError):
    """A file, disk or limit of this machine that keeps the input from being read; a later attempt may succeed."""


class MissingExtraError(MarksError):
    """A library that an optional part of the program needs is not installed."""

    def __init__(self, what: str, library: str, extra: str) -> None:
        super().__init__(
            f"{what} needs {library}", hint=f"install it with: pip install 'tactile-marks[{extra}]'"
        )


def is_machine_error(error: BaseException) -> bool:
    """Check whether disk, system or memory caused an error, whichever file it occurred at."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) or (isinstance(cause, OSError) and cause.errno in _OF_THE_MACHINE):
            return True
        # of no file: tempfile finds no folder that can be written, or the working folder is gone
        if isinstance(cause, FileNotFoundError) and cause.filename is None:
            return True
        cause = cause.__cause__
    return False


_OF_THE_MACHINE = frozenset(
    getattr(errno, name)
    for name in ("EIO", "ENOSPC", "EDQUOT", "EROFS", "EMFILE", "ENFILE", "ENOMEM", "ESTALE", "ETIMEDOUT")
    if hasattr(errno, name)
)
"""Errors of the disk and of the system's limits, not of one file."""


def describe_fault(error: Exception, *, longest: int = 300) -> str:
    """Describe an unexpected error on one line: its kind and message."""
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"fault of the program ({' '.join(said.split())[:longest]})"


def require_file(path: Path, *, most_bytes: int) -> None:
    """Check that there is a file which is not empty and not too long.

    Raises:
        FileError: there is not.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise FileError(path, "is not there", "check the name") from None
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be opened ({error})", "check the name and its permissions") from error
    if not path.is_file():
        raise FileError(path, "is not a file", "name a file")
    if status.st_size == 0:
        raise FileError(path, "is empty", "copy or record it again")
    if status.st_size > most_bytes:
        raise FileError(
            path,
            f"is {status.st_size / 1e6:,.1f} MB long, over the limit of {most_bytes / 1e6:,.1f} MB",
            "crop it",
        )


@contextlib.contextmanager
def report_damage(path: Path, *, kind: str) -> Iterator[None]:
    """Turn any error of a parser on a damaged file into a FileError.

    Parsers of foreign formats meet damage with nearly any exception, MemoryError included; none may end a
    run.
    """
    try:
        yield
    except (FileError, MissingExtraError):
        raise
    except MarksError as error:
        raise FileError(path, error.what, error.hint) from error
    except Exception as error:
        lines = str(error).splitlines()
        reason = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
        raise FileError(
            path, f"is damaged or not a {kind} file ({reason[:200]})", "copy or export it again"
        ) from error
