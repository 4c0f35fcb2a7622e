"""One part of a run before any of its files is opened: words only, to be listed by the million and sent around.

The name of a file is a local path or a URL, as it was given; what such a name says is told here, too.
"""

from __future__ import annotations

import os
import posixpath
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from glyphs.plain_text import visible

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings

_URL = re.compile(r"(?:[a-z0-9+.-]+::)*[a-z][a-z0-9+.-]*://", re.IGNORECASE | re.ASCII)
_PASSWORD = re.compile(r"(?<=://)[^/@:]*:[^/@]*@")
WEB = ("http", "https")
LOCAL = ("file", "local")
_MOST_FILE_NAME = 120


@dataclass(frozen=True, slots=True)
class ListedPart:
    """One part by the names of its files; empty where there is none.

    Attributes:
        name: unique in its list; control characters are written as words.
        height_map: file of its height map.
        scan: file of its recorded scan.
        photo: file of its photograph.
        expected: text that it should read; empty where none is known.
        format: of its serial; empty where the run's is meant.
        font: font of its mark; empty where the run's are meant.
        problem: why it cannot be read, found before any file was opened.
        photo_problem: why its photograph cannot be used, likewise.
        more_photos: files of others of it, under other lights or at other exposures.

    Raises:
        ValueError: a part without a name.
    """

    name: str
    height_map: str = ""
    scan: str = ""
    photo: str = ""
    expected: str = ""
    format: str = ""
    font: str = ""
    problem: FileError | None = None
    photo_problem: FileError | None = None
    more_photos: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("a part without a name; give it one")
        # tables, terminals and logs show names; a file's name may hold control characters
        object.__setattr__(self, "name", visible(self.name))

    @property
    def files(self) -> tuple[str, ...]:
        """Those named: height map, scan, photographs."""
        return tuple(name for name in (self.height_map, self.scan, self.photo, *self.more_photos) if name)


def settings_of(settings: ReadSettings, listed: ListedPart) -> ReadSettings:
    """The settings that a part is read with: its own format and fonts go before the run's."""
    own: dict[str, tuple[str, ...]] = {}
    if listed.format:
        own["format"] = (listed.format,)
    if listed.font:
        own["font"] = tuple(name.strip() for name in listed.font.split(",") if name.strip())
    return settings.model_copy(update=own) if own else settings


class UrlError(FileError):
    """A file that cannot be used and is named by a URL, which no path spells; shown without what is secret in it.

    Attributes:
        url: as it is shown.
    """

    def __init__(self, url: str, what: str, hint: str) -> None:
        self.url = without_secrets(url)
        super().__init__(self.url, what, hint)
        self.args = (self.url, what, hint)  # pickled without the secret


def is_url(text: str) -> bool:
    """Whether a name is a URL (s3://bucket/key), a chain of them (zip://a::s3://b) included; else it is a path."""
    return _URL.match(text) is not None


def without_secrets(url: str) -> str:
    """A URL as it may be shown: without a password, and without the query of a web address, which may sign it."""
    shown = _PASSWORD.sub("***@", url)
    return shown.partition("?")[0] if is_web(shown) else shown


def problem_of(name: str, what: str, hint: str) -> FileError:
    """What is wrong with a file named by a path or a URL."""
    return UrlError(name, what, hint) if is_url(name) else FileError(name, what, hint)


def split_name(name: str) -> tuple[str, str]:
    """Folder and last part of a path or URL; a web address's query is no part of it."""
    if not is_url(name):
        folder, slash, last = name.rpartition("/")
        return (folder or slash, last)
    if is_web(name):
        name = name.partition("?")[0].partition("#")[0]
    scheme, _, rest = name.partition("://")
    folder, _, last = rest.rpartition("/")
    return (f"{scheme}://{folder}", last)


def scheme_of(url: str) -> str:
    """What stands before :// in lower case."""
    return url.partition("://")[0].lower()


def is_web(url: str) -> bool:
    """Whether a URL is a web address, whose folders end in a slash."""
    return scheme_of(url) in WEB


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
        # as a Path spells it, so that what is found and told alike is one; most names need none made for that
        return str(Path(place)) if ("//" in place or "./" in place) and not name.endswith("/") else place
    folder = split_name(source)[0]
    scheme, _, place = folder.partition("://")
    host, _, path = place.partition("/")
    # from the root on, so that no number of .. leads to another host or bucket
    joined = posixpath.normpath(f"/{path}/{name}").lstrip("/") + "/" * name.endswith("/")
    return f"{scheme}://{host}/{joined}"


def absolute(name: str) -> str:
    """A path from the root on; a URL as it is."""
    return name if not name or is_url(name) else os.path.abspath(name)
