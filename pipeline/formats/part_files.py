"""Names of files, paths and URLs, and a part by the names of its files: compact, for lists of a million."""

from __future__ import annotations

import contextlib
import os
import posixpath
import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from glyphs.plain_text import visible
from pipeline.common.names import folded
from pipeline.common.texts import split_commas
from pipeline.errors import is_url, is_web
from pipeline.formats.kinds import HEIGHT_IMAGE_SUFFIXES, file_kind

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings


LOCAL = ("file", "local")
_MOST_FILE_NAME = 120
# number of cached folder listings, so that a table of many missing files lists each folder once
_KEPT_FOLDERS = 16
_MOST_NAMED = 5


def split_name(name: str | PurePath) -> tuple[str, str]:
    """Folder and last part of a path or URL, without the query of a web address."""
    name = name.as_posix() if isinstance(name, PurePath) else name
    if not is_url(name):
        folder, slash, last = name.rpartition("/")
        return (folder or slash, last)
    if is_web(name):
        name = name.partition("?")[0].partition("#")[0]
    scheme, _, place = name.partition("://")
    folder, _, last = place.rpartition("/")
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
    """A file name without path elements, and with its suffix."""
    stem, suffix = os.path.splitext(re.sub(r"[^\w.+ -]", "_", name, flags=re.ASCII).lstrip("."))
    return (stem[: _MOST_FILE_NAME - len(suffix[:20])] or "file") + suffix[:20]


def beside(source: str, name: str) -> str:
    """A file named in a table: URLs and absolute paths unchanged, others relative to the table."""
    if is_url(name):
        return local_name(name)
    if os.path.isabs(name):
        return name
    if not is_url(source):
        place = os.path.join(os.path.dirname(source), name)
        # spelled as Path does, so that equal names compare equal; most names need no Path object for that
        return str(Path(place)) if ("//" in place or "./" in place) and not name.endswith("/") else place
    folder = split_name(source)[0]
    scheme, _, place = folder.partition("://")
    host, _, path = place.partition("/")
    # from the root on, so that no number of .. leads to another host or bucket
    joined = posixpath.normpath(f"/{path}/{name}").lstrip("/") + "/" * name.endswith("/")
    return f"{scheme}://{host}/{joined}"


def absolute(name: str | Path) -> str:
    """An absolute path; URLs are unchanged."""
    return str(name) if not name or is_url(name) else os.path.abspath(name)


def spelling_on_disk(name: str) -> Path:
    """The path of a file in the disk's own spelling. Raises FileError: several differ in spelling alone."""
    path = Path(name)
    if os.path.lexists(path):
        return path
    place = Path(path.anchor)
    for part in path.relative_to(path.anchor).parts:
        if os.path.lexists(place / part):
            place /= part
            continue
        alike = _names(place).get(folded(part), ())
        # the same letters in another composition come before other letters
        same = [name for name in alike if _compose(name) == _compose(part)] or alike
        if not same:
            return path
        if len(same) > 1:
            raise FileError(
                path, f"is not there, but {' and '.join(same[:_MOST_NAMED])} are", "name one as it is spelled"
            )
        place /= same[0]
    return place


@lru_cache(maxsize=_KEPT_FOLDERS)
def _names(folder: Path) -> dict[str, list[str]]:
    alike = defaultdict[str, list[str]](list)
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(folder)):
            alike[folded(name)].append(name)
    return alike


def _compose(name: str) -> str:
    return unicodedata.normalize("NFC", name)


# stem of one of several photographs of a part
_SEVERAL = re.compile(r"(?P<stem>.+)\.(?:light|exposure|shot)-[0-9]+$")


@dataclass(frozen=True, slots=True)
class PartFiles:
    """One part by its files, each a path or URL; empty if missing."""

    name: str  # unique in its list; control characters are written as escapes. An empty one is a ValueError
    height_map: str = ""
    scan: str = ""
    photos: tuple[str, ...] = ()  # taken under several lights or at several exposures
    expected: str = ""
    format: str = ""  # of its serial; empty for that of the run
    font: str = ""  # of its mark; empty for that of the run
    other_text: str = ""  # text that an earlier reading gave with a confidence above 0.5; empty without one
    problem: FileError | None = None  # why it cannot be read, known before any file was opened
    photo_problem: FileError | None = None  # why its photographs cannot be used, likewise

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("a part without a name; give it one")
        # tables, terminals and logs show names; a file's name may hold control characters
        object.__setattr__(self, "name", visible(self.name))

    @property
    def files(self) -> tuple[str, ...]:
        return tuple(file for file in (self.height_map, self.scan, *self.photos) if file)

    @property
    def photo(self) -> str:
        return self.photos[0] if self.photos else ""

    @property
    def felt(self) -> bool:
        return bool(self.height_map or self.scan)

    def absolute(self) -> PartFiles:
        height_map, scan, *photos = map(absolute, (self.height_map, self.scan, *self.photos))
        return replace(self, height_map=height_map, scan=scan, photos=tuple(photos))


def settings_of(settings: ReadSettings, part: PartFiles) -> ReadSettings:
    """The settings for a part: its own format and fonts override those of the run."""
    update: dict[str, tuple[str, ...]] = {}
    if part.format:
        update["format"] = (part.format,)
    if part.font:
        update["font"] = split_commas(part.font)
    return settings.model_copy(update=update) if update else settings


def key_and_kind(file: str, *, height_images: bool = False) -> tuple[tuple[str, str] | None, str]:
    """Folder and stem of a path or URL (None: hidden), and the attribute of a part for its suffix ("": none)."""
    folder, last = split_name(file)
    if not last or last.startswith("."):
        return None, ""
    stem, suffix = os.path.splitext(last)
    if height_images and suffix.lower() in HEIGHT_IMAGE_SUFFIXES:
        return (folder, stem), "height_map"
    return (folder, set_of(file) or stem), file_kind(suffix, tables=False)


def set_of(file: str) -> str:
    """Stem of the set of a photograph such as part.light-2.png; empty for others."""
    stem, suffix = os.path.splitext(split_name(file)[1])
    several = _SEVERAL.match(stem) if file_kind(suffix) == "photo" else None
    return several["stem"] if several else ""


def with_unique_names(parts: Sequence[PartFiles]) -> Sequence[PartFiles]:
    """The parts with unique names: as much of the folder before a name as needed, or numbers after it."""
    names = [p.name for p in parts]
    if len(set(names)) == len(names):
        return parts
    above = [_folders_above(part) for part in parts]
    for depth in range(1, max(map(len, above)) + 1):
        counts = Counter(names)
        for i, part in enumerate(parts):
            if counts[names[i]] > 1:
                names[i] = "/".join(f for f in (*above[i][-depth:], part.name) if f)
    taken, used = set(names), Counter[str]()
    for i, name in enumerate(names):
        used[name] += 1
        if used[name] > 1:
            free = (f"{name} ({number})" for number in count(used[name]))
            names[i] = next(numbered for numbered in free if numbered not in taken)
            taken.add(names[i])
    return [replace(p, name=name) for p, name in zip(parts, names, strict=True)]


def _folders_above(part: PartFiles) -> list[str]:
    if not part.files:
        return []
    folders, named = split_name(part.files[0])[0].replace("://", "/").split("/"), part.name.split("/")[:-1]
    return folders[: -len(named)] if named and folders[-len(named) :] == named else folders
