"""Which parts a command line means: files of one stem in one folder are one part."""

from __future__ import annotations

import glob
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.files import is_height_map, is_photo, is_scan
from pipeline.problems import FileProblem


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
    """

    name: str
    height_map: Path | None = None
    scan: Path | None = None
    photo: Path | None = None
    problem: FileProblem | None = None
    photo_problem: FileProblem | None = None

    @property
    def felt(self) -> bool:
        """Whether there is anything to be felt."""
        return self.height_map is not None or self.scan is not None


class NothingFoundError(Exception):
    """The inputs name no part at all."""


def discover(inputs: Sequence[str | Path], *, photos: bool = False, beside: bool = False) -> list[Part]:
    """The parts that files, folders and globs name, in the order given, a folder's by name.

    In a folder or glob files of other kinds are passed over; named on their own they are parts with a problem,
    as are files that are not there. Beside height maps or scans, a photograph that is none of theirs may be any
    picture.

    Args:
        inputs: files, folders and globs.
        photos: take those for parts, too.
        beside: photographs of the same stem beside a file named belong to its part.

    Raises:
        NothingFoundError: no file at all.
    """
    groups: dict[tuple[Path, str], Part] = {}
    meant: set[tuple[Path, str]] = set()
    listed: dict[Path, list[Path]] = {}
    for given in inputs:
        path = Path(given)
        try:
            exists, folder = path.exists(), path.is_dir()
        except (OSError, ValueError) as error:
            problem = FileProblem(path, f"is no file name ({error})", "check the name")
            groups[(path.parent, path.name)] = Part(path.name[:80], problem=problem)
            continue
        named = not folder and (exists or not glob.has_magic(str(given)))
        if folder:
            paths = sorted(p for p in path.iterdir() if p.is_file())
        elif named:
            paths = [path, *(_photos_of(path, listed) if beside else ())]
        else:
            paths = sorted(Path(p) for p in glob.glob(str(given)) if Path(p).is_file())
        paths = [p for p in paths if not p.name.startswith(".")]
        if photos or named or not any(is_height_map(p) or is_scan(p) for p in paths):
            meant.update(_key(p) for p in paths if is_photo(p))
        for found in paths:
            groups[_key(found)] = _with(groups.get(_key(found), Part(found.stem)), found, named=named)
    kept = {key: p for key, p in groups.items() if p.felt or p.problem or (p.photo and key in meant)}
    if not kept:
        raise NothingFoundError(
            "no height map (.npz, .x3p, .sdf, .sur ...), no scan (.h5) and no photograph (.png, .jpg ...) in "
            + (", ".join(map(str, inputs)) or "nothing")
        )
    return _named_apart(kept)


def _photos_of(path: Path, listed: dict[Path, list[Path]]) -> list[Path]:
    """Photographs of the same stem beside a height map or a scan; folders are listed once."""
    if is_photo(path) or not path.is_file():
        return []
    if path.parent not in listed:
        listed[path.parent] = sorted(p for p in path.parent.iterdir() if is_photo(p) and p.is_file())
    return [p for p in listed[path.parent] if p.stem == path.stem]


def _key(path: Path) -> tuple[Path, str]:
    return (path.parent, path.stem)


def _with(part: Part, path: Path, *, named: bool) -> Part:
    """The part with one more file."""
    if is_scan(path):
        return replace(part, scan=path, problem=part.problem or _twice(part.scan, path))
    if is_photo(path) and (not named or path.exists()):
        problem = part.photo_problem or _twice(part.photo, path)
        return replace(part, photo=part.photo or path, photo_problem=problem)
    if is_height_map(path) or named:
        return replace(part, height_map=path, problem=part.problem or _twice(part.height_map, path))
    return part


def _twice(first: Path | None, second: Path) -> FileProblem | None:
    """Two different files of one kind for one part: which is meant, nobody can tell."""
    if first is None or first == second:
        return None
    return FileProblem(second, f"stands beside {first.name}, so which is the part's is unclear", "rename one")


def _named_apart(groups: Mapping[tuple[Path, str], Part]) -> list[Part]:
    names = [p.name for p in groups.values()]
    return [
        replace(p, name=f"{folder.name}/{p.name}") if names.count(p.name) > 1 else p
        for (folder, _), p in groups.items()
    ]
