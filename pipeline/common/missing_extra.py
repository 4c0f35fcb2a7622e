"""A library that only an optional part needs, and that is not installed."""

from __future__ import annotations


class MissingExtraError(ModuleNotFoundError):
    """A library that an optional part needs is not installed; says how to get it."""

    def __init__(self, what: str, library: str, extra: str) -> None:
        message = f"{what} needs {library}; install it with: pip install 'tactile-marks[{extra}]'"
        super().__init__(message, name=library)
