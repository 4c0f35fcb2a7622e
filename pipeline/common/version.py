"""Versions of the program, files and settings that readings depend on, and their differences."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

_MOST_SHOWN, _MOST_CHARACTERS = 4, 60
_NO_EFFECT = frozenset({"cli", "plots", "service", "report.py", "charts.py", "worst_parts.py"})
"""Packages and files for command line, drawing and service: they change no answer."""


@cache
def program_version() -> str:
    """The installed version; "0" if the program is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("tactile-marks")
    except PackageNotFoundError:
        return "0"


def library_versions(names: Iterable[str]) -> dict[str, str]:
    """Versions of Python and of the named libraries that are installed, and the machine."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    versions = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for name in names:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


@cache
def program_mark() -> str:
    """A hash of the source code: answers of two versions do not belong in one table."""
    import glyphs
    import pipeline
    import recognition
    import whisker_array

    digest = hashlib.sha256()
    for package in (glyphs, whisker_array, recognition, pipeline):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            name = path.relative_to(folder)
            if not _NO_EFFECT.intersection(name.parts):
                digest.update(name.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def reader_versions() -> dict[str, str]:
    """Versions that readings depend on: of the program, and hashes of networks and fitted numbers."""
    import recognition

    hashes = {"tactile-marks": program_version()}
    folder = Path(str(recognition.__file__)).parent
    weights = (p for p in folder.rglob("*") if p.name.endswith((".onnx", "library.npz", ".fit.json")))
    for path in sorted(weights):
        hashes[path.relative_to(folder).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    return hashes


def key_of(description: Mapping[str, Any]) -> str:
    """Hash of a description; the order of its entries does not matter."""
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()[:16]


def file_sha256(path: Path) -> str:
    """Hash of a file's content, hexadecimal. Raises OSError: it cannot be read."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def differences(was: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """The first entries that differ, also in nested tables: "height_mm was 5.0, now 4.0"."""
    wanted = json.loads(json.dumps(dict(now)))
    return "; ".join(islice(_differences(was, wanted, within=""), _MOST_SHOWN))


def _differences(was: Mapping[str, Any], now: Mapping[str, Any], *, within: str) -> Iterator[str]:
    for key in sorted({*was, *now}):
        old, new = was.get(key), now.get(key)
        if isinstance(old, Mapping) and isinstance(new, Mapping):
            yield from _differences(old, new, within=f"{within}{key}.")
        elif old != new:
            name = f"{within}{key}".removeprefix("settings.")
            yield f"{name} was {_in_short(old)}, now {_in_short(new)}"


def _in_short(value: object) -> str:
    if value in (None, "", [], {}):
        return "not set"
    text = ", ".join(map(str, value)) if isinstance(value, list) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _MOST_CHARACTERS else text[: _MOST_CHARACTERS - 3] + "..."
