"""Names of files: paths and URLs as they are given, split, joined, and spelled as the disk spells them."""

from __future__ import annotations

import os
import posixpath
import re
import unicodedata
from functools import lru_cache
from pathlib import Path

from glyphs.errors import FileError
from pipeline.errors import is_url, is_web

LOCAL = ("file", "local")
_MOST_FILE_NAME = 120
# folders whose names are kept, so that a table of many missing files lists each folder once
_KEPT_FOLDERS = 16
_MOST_NAMED = 5


def split_name(name: str | Path) -> tuple[str, str]:
    """Folder and last part of a path or URL; a web address's query is no part of it."""
    name = str(name)
    if not is_url(name):
        folder, slash, last = name.rpartition("/")
        return (folder or slash, last)
    if is_web(name):
        name = name.partition("?")[0].partition("#")[0]
    scheme, _, rest = name.partition("://")
    folder, _, last = rest.rpartition("/")
    return (f"{scheme}://{folder}", last)


def scheme_of(url: str) -> str:
    """The scheme of a URL in lower case."""
    return url.partition("://")[0].lower()


def has_magic(url: str) -> bool:
    """Whether a URL is a glob; in a web address ? and [ mean something else."""
    return "*" in url.partition("?")[0] if is_web(url) else bool(re.search(r"[*?[]", url))


def local_name(name: str) -> str:
    """The path that a file:// URL names; other names as they are."""
    return name.split("://", 1)[1] if is_url(name) and scheme_of(name) in LOCAL else name


def harmless_name(name: str) -> str:
    """A file name without anything that leads elsewhere, and with the suffix kept."""
    stem, suffix = os.path.splitext(re.sub(r"[^\w.+ -]", "_", name, flags=re.ASCII).lstrip("."))
    return (stem[: _MOST_FILE_NAME - len(suffix[:20])] or "file") + suffix[:20]


def beside(source: str, name: str) -> str:
    """A file as the table names it: URLs and absolute paths as they are, others beside the table."""
    if is_url(name):
        return local_name(name)
    if os.path.isabs(name):
        return name
    if not is_url(source):
        place = os.path.join(os.path.dirname(source), name)
        # spelled as Path spells it, so that equal names compare equal; most names need no Path object for that
        return str(Path(place)) if ("//" in place or "./" in place) and not name.endswith("/") else place
    folder = split_name(source)[0]
    scheme, _, place = folder.partition("://")
    host, _, path = place.partition("/")
    # from the root on, so that no number of .. leads to another host or bucket
    joined = posixpath.normpath(f"/{path}/{name}").lstrip("/") + "/" * name.endswith("/")
    return f"{scheme}://{host}/{joined}"


def absolute(name: str | Path) -> str:
    """A path from the root on; a URL as it is."""
    return str(name) if not name or is_url(name) else os.path.abspath(name)


def spelled_on_disk(name: str) -> Path:
    """The path of a file as the disk spells it; as it is given where there is no such file.

    Raises:
        FileError: several files differ from the name in spelling alone.
    """
    path = Path(name)
    if os.path.lexists(path):
        return path
    found = Path(path.anchor)
    for part in path.relative_to(path.anchor).parts:
        if os.path.lexists(found / part):
            found /= part
            continue
        alike = _names(str(found), _changed_ns(found)).get(_folded(part), ())
        # another composition of the same letters goes before other letters
        same = [one for one in alike if _composed(one) == _composed(part)] or alike
        if not same:
            return path
        if len(same) > 1:
            raise FileError(
                path, f"is not there, and {' and '.join(same[:_MOST_NAMED])} are", "name one as it is spelled"
            )
        found /= same[0]
    return found


@lru_cache(maxsize=_KEPT_FOLDERS)
def _names(folder: str, changed_ns: int) -> dict[str, list[str]]:
    """The names in a folder by their folded spelling; empty of none that can be listed."""
    names: dict[str, list[str]] = {}
    try:
        for one in sorted(os.listdir(folder)):
            names.setdefault(_folded(one), []).append(one)
    except OSError:
        return {}
    return names


def _changed_ns(folder: Path) -> int:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _folded(name: str) -> str:
    return _composed(name).casefold()
