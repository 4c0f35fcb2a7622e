"""Find the parts of a run from file names, without opening files: files of one stem in one folder are one part.

part-003.h5  part-003.light-1.png  part-003.light-2.png     one part, scanned and photographed under two lights
tray-7/part-003.h5                                          tray-7/part-003, in a subfolder
"""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, MarksError
from glyphs.plain_text import visible
from pipeline.common.texts import first_of
from pipeline.errors import is_url, is_web, problem_of
from pipeline.formats.kinds import (
    OF_SYSTEM,
    PHOTO_SUFFIXES,
    READ_NAMES,
    TABLE_SUFFIXES,
    UNREAD_PICTURE_SUFFIXES,
    is_system_folder,
    why_not_searched,
)
from pipeline.formats.manifest import is_manifest, names_no_files, read_manifest
from pipeline.formats.part_files import (
    PartFiles,
    has_magic,
    key_and_kind,
    local_name,
    set_of,
    split_name,
    with_unique_names,
)

_MOST_NAME = 80
_MOST_NAMES = 20
# keys of the counts beside suffixes
_NO_SUFFIX = ("hidden", "folder")
_HINTS = (
    (PHOTO_SUFFIXES, "lone photographs are read without --mode, heights in pictures with --height-image"),
    (UNREAD_PICTURE_SUFFIXES, f"photographs must be {READ_NAMES}"),
    (TABLE_SUFFIXES, "a table is only read if it is named itself"),
)


class NothingFoundError(MarksError):
    """The inputs name no part at all."""

    is_usage = False

    def __init__(self, inputs: Sequence[str | Path], passed_over: str = "") -> None:
        super().__init__(
            "no height map (.npz, .x3p, .sdf, .sur ...), no scan (.h5) and no photograph (.png, .jpg ...) in "
            + (", ".join(map(str, inputs)) or "nothing"),
            hint=passed_over,
        )


@dataclass(frozen=True)
class PassedOver:
    """Files of folders that belong to no part, hidden ones, and folders that were not searched, with the reason."""

    files: list[str] = field(default_factory=list)
    hidden: list[str] = field(default_factory=list)
    folders: dict[str, str] = field(default_factory=dict)

    def without(self, used: Iterable[str | Path]) -> PassedOver:
        known = {os.path.realpath(file) for file in used}
        files = [file for file in self.files if is_url(file) or os.path.realpath(file) not in known]
        return replace(self, files=files)

    @property
    def counts(self) -> Counter[str]:
        suffixes = (os.path.splitext(split_name(file)[1])[1] for file in self.files)
        counts = Counter(suffix.lower()[:20] or "no suffix" for suffix in suffixes)
        return counts + Counter(hidden=len(self.hidden), folder=len(self.folders))

    def describe(self) -> str:
        texts = []
        if self.files:
            kinds = {suffix: n for suffix, n in sorted(self.counts.items()) if suffix not in _NO_SUFFIX}
            counts = ", ".join(f"{n} {suffix}" for suffix, n in kinds.items())
            names = first_of([split_name(file)[1] for file in self.files], _MOST_NAMES)
            texts = [f"passed over {_number(self.files, 'file')} ({counts}): {names}"]
            texts += [hint for suffixes, hint in _HINTS if not kinds.keys().isdisjoint(suffixes)]
        if self.hidden:
            names = first_of([split_name(file)[1] for file in self.hidden], _MOST_NAMES)
            texts.append(f"passed over {_number(self.hidden, 'hidden file')}: {names}")
        if self.folders:
            names = first_of(
                [f"{split_name(place)[1]} ({why})" for place, why in self.folders.items()], _MOST_NAMES
            )
            texts.append(f"passed over {_number(self.folders, 'folder')}: {names}")
        return visible("; ".join(texts))


def _number(counted: Collection[str], noun: str) -> str:
    return f"1 {noun}" if len(counted) == 1 else f"{len(counted):,} {noun}s"


class Listing(list[PartFiles]):
    """Found parts, and the files and folders that were passed over."""

    def __init__(self, parts: Iterable[PartFiles], passed_over: PassedOver) -> None:
        super().__init__(parts)
        self.passed_over = passed_over

    def report_passed_over(self, used: Iterable[str | Path] = ()) -> None:
        if line := self.passed_over.without(used).describe():
            print(line)


def discover(
    inputs: Sequence[str | Path],  # files, folders and globs, of this machine or by URL; manifests (.csv)
    *,
    manifests: Sequence[str] = (),
    recurse: bool = True,
    photos: bool = True,  # ones without map and scan are parts; if not, those of folders are passed over
    beside: bool = False,  # those beside a named local file with its stem belong to its part
    height_images: bool = False,  # .png and .tif are height maps, not photographs
) -> Listing:
    """List the parts that the inputs name, in the order given; the parts of a folder are sorted by name.

    Files of other kinds are passed over in a folder or glob, and are parts with a problem if named on their own, as
    missing files are. Hidden folders, folders of the system, links to folders and subfolders of a web server are not
    searched. A URL with the suffix of a known kind counts as a file without a check. Raises NothingFoundError: there is
    no file. FileError: a manifest or folder cannot be used. MissingExtraError: a library that URLs need is not
    installed.
    """
    from pipeline.formats.remote import list_remote

    names = [local_name(str(name)) for name in inputs]
    if len(names) + len(manifests) == 1 and (manifests or is_manifest(names[0])):
        return Listing(read_manifest((*names, *manifests)[0]), PassedOver())
    part_files = FoundFiles(recurse=recurse, photos=photos, height_images=height_images)
    for name in names:
        if len(names) > 1 and names_no_files(name):  # of a glob that the shell has expanded
            part_files.passed_over.files.append(name)
        elif len(names) > 1 and is_system_folder(split_name(name)[1]) and os.path.isdir(name):  # likewise
            part_files.passed_over.folders[name] = OF_SYSTEM
        elif is_manifest(name):
            part_files.add_listed(read_manifest(name))
        elif not is_url(name):
            part_files.add_local(name, beside=beside)
        elif not has_magic(name) and not name.endswith("/") and (is_web(name) or key_and_kind(name)[1]):
            part_files.add([name], named=True)
        else:
            groups, folders = list_remote(name, recurse=recurse)
            for root, files in groups:
                part_files.add(files, named=files == [name], root=root)
            part_files.passed_over.folders.update(folders)
    for manifest in manifests:
        part_files.add_listed(read_manifest(manifest))
    parts = part_files.parts()
    if not parts:
        raise NothingFoundError([*inputs, *manifests], part_files.passed_over.describe())
    return Listing(with_unique_names(parts), part_files.passed_over)


class FoundFiles:
    """Files, grouped to parts by folder and stem, as in `discover`; `passed_over` is complete after `parts`."""

    def __init__(self, *, recurse: bool, photos: bool, height_images: bool) -> None:
        self._recurse, self._photos = recurse, photos
        self._key_and_kind = partial(key_and_kind, height_images=height_images)
        self.passed_over = PassedOver()
        self._parts: dict[tuple[str, ...], PartFiles] = {}
        self._named: set[tuple[str, ...]] = set()
        self._beside: dict[str, dict[str, list[str]]] = {}

    def add_local(self, name: str, *, beside: bool = False) -> None:
        path = Path(name).as_posix()
        if os.path.isdir(path):
            self._add_folder(path, root=path)
        elif os.path.exists(name) or not glob.has_magic(name):
            self.add([path, *(self._photos_of(path) if beside else ())], named=True)
        else:
            paths = sorted(Path(p).as_posix() for p in glob.glob(name, recursive=True))
            folders = [path for path in paths if os.path.isdir(path)]
            self.add([path for path in paths if os.path.isfile(path)])
            for folder in folders if "**" not in name else ():
                if is_system_folder(split_name(folder)[1]):
                    self.passed_over.folders[folder] = OF_SYSTEM
                else:
                    self._add_folder(folder, root=folder)

    def _add_folder(self, folder: str, *, root: str) -> None:
        files, folders = _entries(folder)
        self.add(files, root=root)
        for below in folders:
            why = "" if self._recurse else "--no-recurse"
            why = "a link" if os.path.islink(below) else why
            why = why_not_searched(split_name(below)[1]) or why
            try:
                if not why:
                    self._add_folder(below, root=root)
            except FileError as error:
                why = error.what
            if why:
                self.passed_over.folders[below] = why

    def add(self, files: Sequence[str], *, named: bool = False, root: str = "") -> None:
        """Add the files of folders or of a glob, or one file `named` on its own with the photographs beside it, of
        whatever kind; parts below the `root` that the user named have their subfolder in their names."""
        for file in files:
            key, kind = self._key_and_kind(file)
            if key is None:
                if root or named:  # a glob names no hidden file
                    self.passed_over.hidden.append(file)
                continue
            if named:
                kind = kind or kind_of_named(file)
                self._named.add(key)
            if not kind:
                self.passed_over.files.append(file)
                continue
            if (part := self._parts.get(key)) is None:
                below = key[0].removeprefix(root).strip("/") if root else ""
                part = PartFiles(f"{below}/{_stem_name(key[1])}".lstrip("/"))
            self._parts[key] = with_file(part, kind, file)

    def add_listed(self, parts: Iterable[PartFiles]) -> None:
        for part in parts:
            key = ("", "", str(len(self._parts)))
            self._named.add(key)
            self._parts[key] = part

    def parts(self) -> list[PartFiles]:
        parts: dict[tuple[str, ...], PartFiles] = {}
        for key, part in self._parts.items():
            if not (self._photos or part.felt or part.problem or key in self._named):
                self.passed_over.files.extend(part.files)
                continue
            same = (part.name, *(part.files or (str(part.problem),)))
            # of two entries for one part keep the one with more information
            if same not in parts or (_says_more(part) and not _says_more(parts[same])):
                parts[same] = part
        return list(parts.values())

    def _photos_of(self, path: str) -> list[str]:
        key, kind = self._key_and_kind(path)
        if key is None or kind == "photo" or not os.path.isfile(path):
            return []
        folder = Path(path).parent.as_posix()
        if folder not in self._beside:
            stems = self._beside[folder] = {}
            for file in _entries(folder)[0]:
                other, kind = self._key_and_kind(file)
                if other is not None and kind == "photo":
                    stems.setdefault(other[1], []).append(file)
        return self._beside[folder].get(key[1], [])


def _entries(folder: str) -> tuple[list[str], list[str]]:
    try:
        with os.scandir(folder) as entries:
            paths = sorted((Path(e.path).as_posix(), _is_file(e)) for e in entries)
    except OSError as error:
        what = f"cannot be listed ({error.strerror or error})"
        raise FileError(folder, what, "check its permissions") from error
    return [name for name, file in paths if file], [
        name for name, file in paths if not file and os.path.isdir(name)
    ]


def _is_file(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file() or (entry.is_symlink() and not os.path.exists(entry.path))
    except OSError:
        return True


def kind_of_named(file: str) -> str:
    """The attribute of a part for a named file of an unsupported kind, which its reader refuses."""
    suffix = os.path.splitext(split_name(file)[1])[1].lower()
    return "photo" if suffix in UNREAD_PICTURE_SUFFIXES else "height_map"


def with_file(part: PartFiles, kind: str, file: str) -> PartFiles:
    """Add a file to a part, which may have several numbered photographs (part.light-2.png), but one of other kinds."""
    if kind == "photo" and (file in part.photos or not part.photos or set_of(file)):
        return part if file in part.photos else replace(part, photos=(*part.photos, file))
    first, problem = str(getattr(part, kind)), None
    if first and first != file:
        what = f"stands beside {split_name(first)[1]}, so it is unclear which one belongs to the part"
        problem = problem_of(file, what, "rename one")
    if kind == "photo":
        return replace(part, photo_problem=part.photo_problem or problem)
    files: dict[str, Any] = {kind: file}
    return replace(part, **files, problem=part.problem or problem)


# a file's name may hold any bytes, and a part's name is stored
def _stem_name(stem: str) -> str:
    return stem.encode("utf-8", "replace").decode()[: _MOST_NAME if len(stem) > 255 else None]


def _says_more(part: PartFiles) -> bool:
    return bool(part.expected or part.format or part.font)
