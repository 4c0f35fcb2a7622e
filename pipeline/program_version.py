"""Which version of the program this is."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def program_version() -> str:
    """The installed version; "0" where the program runs without having been installed."""
    try:
        return version("tactile-marks")
    except PackageNotFoundError:
        return "0"
