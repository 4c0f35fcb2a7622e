"""Errors that a user can correct: wrong input, settings, files, machines. Any other exception is a bug."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

from glyphs.plain_text import visible


class MarksError(Exception):
    """An expected failure, "where: what; hint". It can be pickled if all keyword arguments of a subclass have
    defaults."""

    is_usage: ClassVar[bool] = True

    def __init__(self, what: str, *, where: str = "", hint: str = "") -> None:
        # BaseException.__new__ has stored the positional arguments; unpickling calls the class with them
        self.what, self.where, self.hint = what, where, hint

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        todo = f"; {self.hint}" if self.hint else ""
        return visible(" ".join(f"{place}{self.what}{todo}".split()))


class FileError(MarksError):
    """A file that cannot be used."""

    is_usage = False

    def __init__(self, path: str | Path, what: str, hint: str) -> None:
        super().__init__(what, where=str(path), hint=hint)
        self.path = Path(path)


class MissingExtraError(MarksError):
    """A library that an optional part of the program needs is not installed."""

    def __init__(self, what: str, library: str, extra: str) -> None:
        super().__init__(
            f"{what} needs {library}", hint=f"install it with: pip install 'tactile-marks[{extra}]'"
        )


@contextlib.contextmanager
def report_damage(path: Path, *, kind: str) -> Iterator[None]:
    """Turn any error of a foreign parser into a FileError: they raise nearly anything, even MemoryError."""
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
