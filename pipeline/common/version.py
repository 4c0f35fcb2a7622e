"""Which version of the program this is."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

_WITHOUT_A_SAY = frozenset(
    {"cli", "plots", "service", "report.py", "charts.py", "curves.py", "worst_parts.py"}
)
"""Rooms and files that read command lines, draw and serve: they change no answer."""


def program_version() -> str:
    """The installed version; "0" where the program runs without having been installed."""

    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("tactile-marks")
    except PackageNotFoundError:
        return "0"


@cache
def program_mark() -> str:
    """A hash of the program's text: what two versions answer does not belong in one table."""
    import hashlib

    import glyphs
    import pipeline
    import recognition
    import whisker_array

    digest = hashlib.sha256()
    for package in (glyphs, whisker_array, recognition, pipeline):
        for path in _sources(Path(str(package.__file__)).parent):
            digest.update(
                path.relative_to(Path(str(package.__file__)).parent).as_posix().encode() + path.read_bytes()
            )
    return digest.hexdigest()[:16]


def _sources(folder: Path) -> Iterable[Path]:
    return sorted(
        p for p in folder.rglob("*.py") if not _WITHOUT_A_SAY.intersection(p.relative_to(folder).parts)
    )


@cache
def reader_versions() -> dict[str, str]:
    """What readings depend on beside settings: the program's version, and hashes of networks and fitted numbers."""
    import hashlib

    import recognition

    found = {"tactile-marks": program_version()}
    folder = Path(str(recognition.__file__)).parent
    for path in sorted(p for p in folder.rglob("*") if p.suffix == ".onnx" or p.name.endswith(".fit.json")):
        found[path.relative_to(folder).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    return found
