"""What goes wrong with a file, in words for the person who has to mend it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path


class FileProblem(Exception):  # noqa: N818 - a row of a table, more than an exception
    """A file that cannot be used.

    Attributes:
        path: the file.
        problem: what is wrong with it.
        hint: what to do about it.
    """

    def __init__(self, path: str | Path, problem: str, hint: str) -> None:
        super().__init__(f"{path}: {problem}; {hint}")
        self.path = Path(path)
        self.problem = problem
        self.hint = hint

    def __reduce__(self) -> tuple[type[FileProblem], tuple[str, str, str]]:
        # an exception is pickled by its message alone unless told otherwise
        return (type(self), (str(self.path), self.problem, self.hint))

    def __str__(self) -> str:
        return " ".join(f"{self.path}: {self.problem}; {self.hint}".split())


def require_file(path: Path, *, most_bytes: int) -> None:
    """Check that there is a file which is not empty and not too long.

    Raises:
        FileProblem: there is not.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise FileProblem(path, "is not there", "check the name") from None
    except (OSError, ValueError) as error:
        raise FileProblem(
            path, f"cannot be opened ({error})", "check the name and its permissions"
        ) from error
    if not path.is_file():
        raise FileProblem(path, "is no file", "name a file")
    if status.st_size == 0:
        raise FileProblem(path, "is empty", "copy or record it again")
    if status.st_size > most_bytes:
        raise FileProblem(
            path,
            f"is {status.st_size / 1e9:.1f} GB long, over the limit of {most_bytes / 1e9:.1f} GB",
            "crop it",
        )


@contextlib.contextmanager
def damage_reported(path: Path, *, kind: str) -> Iterator[None]:
    """Turn whatever a parser trips over in a damaged file into a FileProblem.

    Parsers of foreign formats meet damage with nearly any exception, MemoryError included; none may end a
    run.
    """
    try:
        yield
    except FileProblem:
        raise
    except Exception as error:
        lines = str(error).splitlines()
        reason = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
        raise FileProblem(
            path, f"is damaged or no {kind} file ({reason[:200]})", "copy or export it again"
        ) from error
