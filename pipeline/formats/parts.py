"""Which parts a command line means: files of one stem in one folder are one part.

    part-003.h5  part-003.light-1.png  part-003.light-2.png     one part, felt and photographed under two lights

folder, glob, file --FoundFiles--> ListedPart (words) --discover--> Part (paths)
"""

from __future__ import annotations

import glob
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from glyphs.errors import FileError, MarksError
from pipeline.formats.kinds import (
    CORE_SUFFIXES,
    FORMATS_SUFFIXES,
    HEIGHT_IMAGE_SUFFIXES,
    PHOTO_SUFFIXES,
    SCAN_SUFFIXES,
    UNREAD_PICTURE_SUFFIXES,
)
from pipeline.formats.listed import ListedPart, problem_of, split_name
from pipeline.formats.part_list import PartList
from pipeline.formats.passed_over import PassedOver

_KINDS = {
    **dict.fromkeys(CORE_SUFFIXES + FORMATS_SUFFIXES, "height_map"),
    **dict.fromkeys(SCAN_SUFFIXES, "scan"),
    **dict.fromkeys(PHOTO_SUFFIXES, "photo"),
}
"""Attribute of a part that a file of each suffix is."""
_SEVERAL = re.compile(r"(?P<stem>.+)\.(?:light|exposure|shot)-[0-9]+$")
"""Stem of one of several photographs of a part."""
_MOST_NAME = 80


@dataclass(frozen=True)
class Part:
    """One part and the files that tell of it.

    Attributes:
        name: stem of its files; with the folder's name before it where the stem alone is not unique.
        height_map: file of its height map.
        scan: file of its recorded scan.
        photo: file of its photograph.
        problem: why it cannot be read, found before any file was opened.
        photo_problem: why its photograph cannot be used, likewise.
        more_photos: files of others of it, from the same place.
    """

    name: str
    height_map: Path | None = None
    scan: Path | None = None
    photo: Path | None = None
    problem: FileError | None = None
    photo_problem: FileError | None = None
    more_photos: tuple[Path, ...] = ()

    @property
    def felt(self) -> bool:
        """Whether there is anything to be felt."""
        return self.height_map is not None or self.scan is not None


class NothingFoundError(MarksError):
    """The inputs name no part at all."""

    def __init__(self, inputs: Sequence[str | Path], passed_over: str = "") -> None:
        super().__init__(
            "no height map (.npz, .x3p, .sdf, .sur ...), no scan (.h5) and no photograph (.png, .jpg ...) in "
            + (", ".join(map(str, inputs)) or "nothing"),
            hint=passed_over,
        )


def discover(
    inputs: Sequence[str | Path], *, photos: bool = False, beside: bool = False, height_images: bool = False
) -> list[Part]:
    """The parts that files, folders and globs of this machine name, in the order given, a folder's by name.

    In a folder or glob files of other kinds are passed over; named on their own they are parts with a problem,
    as are files that are not there. Beside height maps or scans, a photograph that is none of theirs may be any
    picture.

    Args:
        inputs: files, folders and globs.
        photos: take those for parts, too.
        beside: photographs of the same stem beside a file named belong to its part.
        height_images: .png and .tif are height maps, and no photographs.

    Raises:
        NothingFoundError: no file at all.
        FileError: a folder that cannot be listed.
    """
    found = FoundFiles(photos=photos, height_images=height_images)
    for given in inputs:
        found.add_local(given, beside=beside)
    parts = found.parts()
    if not parts:
        raise NothingFoundError(inputs, found.passed_over.describe())
    return [_part_of(p) for p in named_apart(parts)]


def _part_of(listed: ListedPart) -> Part:
    return Part(
        listed.name,
        height_map=Path(listed.height_map) if listed.height_map else None,
        scan=Path(listed.scan) if listed.scan else None,
        photo=Path(listed.photo) if listed.photo else None,
        more_photos=tuple(map(Path, listed.more_photos)),
        problem=listed.problem,
        photo_problem=listed.photo_problem,
    )


class FoundFiles:
    """Files as they are found, put together to parts by folder and stem.

    Attributes:
        passed_over: files of folders that no part is made of; complete after `parts`.
    """

    def __init__(self, *, photos: bool = False, height_images: bool = False) -> None:
        """Begin without any.

        Args:
            photos: photographs in folders are parts of their own, too, beside height maps and scans.
            height_images: .png and .tif are height maps, and no photographs.
        """
        self._photos, self._height_images = photos, height_images
        self.passed_over = PassedOver()
        self._parts: dict[tuple[str, ...], ListedPart] = {}
        self._meant: set[tuple[str, ...]] = set()
        self._beside: dict[str, dict[str, list[str]]] = {}

    def add_local(self, given: str | Path, *, beside: bool = False) -> None:
        """What a file, a folder or a glob of this machine names.

        Raises:
            FileError: a folder that cannot be listed.
        """
        path = Path(given)
        try:
            exists, folder = path.exists(), path.is_dir()
        except (OSError, ValueError) as error:
            problem = FileError(path, f"is not a file name ({error})", "check the name")
            key = split_name(str(path))
            self._parts[key] = ListedPart(_stem_name(key[1] or str(path)), problem=problem)
            return
        if folder:
            self.add(_files_in(str(path)))
        elif exists or not glob.has_magic(str(given)):
            self.add([str(path), *(self._photos_of(str(path)) if beside else ())], named=True, there=exists)
        else:
            self.add(sorted(str(Path(p)) for p in glob.glob(str(given)) if os.path.isfile(p)))

    def add(self, files: Sequence[str], *, named: bool = False, there: bool = True) -> None:
        """Files of one folder or glob, or one named on its own with what belongs to it.

        Args:
            files: paths or URLs; hidden ones are passed over.
            named: the kind of the first does not matter, it is a part.
            there: it exists, as far as is known.
        """
        seen = [(key, kind, f) for f in files for key, kind in (self._key_and_kind(f),) if key is not None]
        if named:
            seen = [(key, kind or _kind_of_named(f), f) for key, kind, f in seen]
        if self._photos or named or not any(kind in ("height_map", "scan") for _, kind, _ in seen):
            self._meant.update(key for key, kind, _ in seen if kind == "photo")
        for key, kind, file in seen:
            if named and kind == "photo" and not there:
                kind = "height_map"
            if not kind:
                self.passed_over.add(file)
                continue
            self._parts[key] = _with(self._parts.get(key) or ListedPart(_stem_name(key[1])), kind, file)

    def add_told(self, parts: Iterable[ListedPart]) -> None:
        """Parts that a manifest tells of; one told twice in the same words is one part."""
        for part in parts:
            key = ("", part.name, *part.files)
            self._parts[key] = _fuller(self._parts.get(key), part)
            if part.photo:
                self._meant.add(key)

    def parts(self) -> list[ListedPart]:
        """The parts in the order in which their first files were found; one found and told alike stands once."""
        parts: dict[tuple[str, ...], ListedPart] = {}
        for key, part in self._parts.items():
            if part.height_map or part.scan or part.problem or (part.photo and key in self._meant):
                same = (part.name, *(part.files or (str(part.problem),)))
                parts[same] = _fuller(parts.get(same), part)
            else:
                for file in part.files:
                    self.passed_over.add(file)
        return list(parts.values())

    def _key_and_kind(self, file: str) -> tuple[tuple[str, str] | None, str]:
        return key_and_kind(file, height_images=self._height_images)

    def _photos_of(self, path: str) -> list[str]:
        """Photographs of the same stem beside a height map or a scan; folders are listed once."""
        key, kind = self._key_and_kind(path)
        if key is None or kind == "photo" or not os.path.isfile(path):
            return []
        folder = str(Path(path).parent)
        if folder not in self._beside:
            stems: dict[str, list[str]] = {}
            for found in _files_in(folder):
                other, kind = self._key_and_kind(found)
                if other is not None and kind == "photo":
                    stems.setdefault(other[1], []).append(found)
            self._beside[folder] = stems
        return self._beside[folder].get(key[1], [])


def _files_in(folder: str) -> list[str]:
    """Files of a folder by name; what kind they are is known without asking for each."""
    before = "" if folder == "." else folder.rstrip("/") + "/"
    try:
        with os.scandir(folder) as entries:
            return [before + name for name in sorted(e.name for e in entries if e.is_file())]
    except OSError as error:
        raise FileError(
            folder, f"cannot be listed ({error.strerror or error})", "check its permissions"
        ) from error


def key_and_kind(file: str, *, height_images: bool = False) -> tuple[tuple[str, str] | None, str]:
    """Folder and stem of a path or URL (None: hidden), and which attribute of a part its suffix means ("": none)."""
    folder, last = split_name(file)
    if not last or last.startswith("."):
        return None, ""
    stem, suffix = os.path.splitext(last)
    if height_images and suffix.lower() in HEIGHT_IMAGE_SUFFIXES:
        return (folder, stem), "height_map"
    kind = _KINDS.get(suffix.lower(), "")
    return (folder, set_of(file) or stem), kind


def _kind_of_named(file: str) -> str:
    """The attribute of a part whose reader refuses a file that is named, but of no kind that is read."""
    suffix = os.path.splitext(split_name(file)[1])[1].lower()
    return "photo" if suffix in UNREAD_PICTURE_SUFFIXES else "height_map"


def _with(part: ListedPart, kind: str, file: str) -> ListedPart:
    """The part with one more file; two different files of one kind: which is meant, nobody can tell.

    Photographs that are numbered (part.light-2.png) are all meant.
    """
    first: str = getattr(part, kind)
    if kind == "photo" and first and file not in (first, *part.more_photos) and set_of(file):
        return replace(part, more_photos=(*part.more_photos, file))
    problem = None
    if first and first != file:
        beside = split_name(first)[1]
        problem = problem_of(file, f"stands beside {beside}, so which is the part's is unclear", "rename one")
    if kind == "photo":
        return replace(part, photo=first or file, photo_problem=part.photo_problem or problem)
    if kind == "scan":
        return replace(part, scan=file, problem=part.problem or problem)
    return replace(part, height_map=file, problem=part.problem or problem)


def set_of(file: str) -> str:
    """Stem of the set that one of several photographs belongs to (part.light-2.png); empty of others."""
    stem, suffix = os.path.splitext(split_name(file)[1])
    several = _SEVERAL.match(stem) if _KINDS.get(suffix.lower()) == "photo" else None
    return several["stem"] if several else ""


def _stem_name(stem: str) -> str:
    """A name that can be stored, whatever bytes the file's name is made of."""
    return stem.encode("utf-8", "replace").decode()[: _MOST_NAME if len(stem) > 255 else None]


def _fuller(known: ListedPart | None, part: ListedPart) -> ListedPart:
    """Of one part told twice the one that says more; else the first."""
    if known is None or (not _told(known) and _told(part)):
        return part
    return known


def _told(part: ListedPart) -> bool:
    return bool(part.expected or part.format or part.font)


def named_apart(parts: Sequence[ListedPart]) -> Sequence[ListedPart]:
    """The parts with names that are unique: as much of its folder before a name as that takes.

    Parts of one name and one folder, which only manifests can tell of, are numbered.
    """
    names = [p.name for p in parts]
    if len(set(names)) == len(names):
        return parts

    def folders(part: ListedPart) -> list[str]:
        return split_name(part.files[0])[0].replace("://", "/").split("/") if part.files else []

    depth = 0
    while clash := _not_unique(names):
        depth += 1
        deeper = False
        for i in clash:
            part = parts[i]
            above = folders(part)
            deeper |= len(above) >= depth
            names[i] = "/".join(f for f in (*above[-depth:], part.name) if f)
        if not deeper:
            break
    taken = set(names)
    seen: set[str] = set()
    for i, name in enumerate(names):
        number = 1
        while names[i] in seen or (number > 1 and names[i] in taken):
            number += 1
            names[i] = f"{name} ({number})"
        seen.add(names[i])
    return PartList(replace(p, name=name) for p, name in zip(parts, names, strict=True))


def _not_unique(names: Sequence[str]) -> list[int]:
    counts = Counter(names)
    return [] if len(counts) == len(names) else [i for i, name in enumerate(names) if counts[name] > 1]
