"""Which parts a command line means: files of one stem in one folder are one part."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Sequence
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
    """

    name: str
    height_map: Path | None = None
    scan: Path | None = None
    photo: Path | None = None
    problem: FileProblem | None = None


class NothingFoundError(Exception):
    """The inputs name no part at all."""


def discover(inputs: Sequence[str | Path]) -> list[Part]:
    """The parts that files, folders and globs name, in the order given, a folder's by name.

    In a folder, files of other kinds and photographs alone are passed over; named on their own they are parts
    with a problem, as are files that are not there.

    Raises:
        NothingFoundError: no file at all.
    """
    groups: dict[tuple[Path, str], Part] = {}
    for given in inputs:
        path = Path(given)
        try:
            exists, folder = path.exists(), path.is_dir()
        except (OSError, ValueError) as error:
            problem = FileProblem(path, f"is no file name ({error})", "check the name")
            groups[(path.parent, path.name)] = Part(path.name[:80], problem=problem)
            continue
        if folder:
            _add(groups, sorted(p for p in path.iterdir() if p.is_file()), named=False)
        elif exists or not glob.has_magic(str(given)):
            _add(groups, [path], named=True)
        else:
            _add(groups, sorted(Path(p) for p in glob.glob(str(given)) if Path(p).is_file()), named=False)
    parts = [p for p in groups.values() if p.height_map or p.scan or p.problem]
    if not parts:
        raise NothingFoundError(
            "no height map (.npz, .x3p, .sdf, .sur ...) and no scan (.h5) in "
            + (", ".join(map(str, inputs)) or "nothing")
        )
    return _named_apart(groups, parts)


def _add(groups: dict[tuple[Path, str], Part], paths: Iterable[Path], *, named: bool) -> None:
    for path in paths:
        if path.name.startswith("."):
            continue
        key = (path.parent, path.stem)
        groups[key] = _with(groups.get(key, Part(path.stem)), path, named=named)


def _with(part: Part, path: Path, *, named: bool) -> Part:
    """The part with one more file."""
    if is_scan(path):
        return replace(part, scan=path, problem=part.problem or _twice(part.scan, path))
    if is_photo(path) and (not named or path.exists()):
        part = replace(part, photo=path)
        if named and not (part.height_map or part.scan):
            alone = FileProblem(
                path, "is a photograph, which touch cannot read", "name a height map or a scan"
            )
            return replace(part, problem=alone)
        return part
    if is_height_map(path) or named:
        kept = None if part.problem is not None and part.problem.path == part.photo else part.problem
        return replace(part, height_map=path, problem=kept or _twice(part.height_map, path))
    return part


def _twice(first: Path | None, second: Path) -> FileProblem | None:
    """Two different files of one kind for one part: which is meant, nobody can tell."""
    if first is None or first == second:
        return None
    return FileProblem(second, f"stands beside {first.name}, so which is the part's is unclear", "rename one")


def _named_apart(groups: dict[tuple[Path, str], Part], parts: list[Part]) -> list[Part]:
    folders = {id(part): folder for (folder, _), part in groups.items()}
    names = [p.name for p in parts]
    return [
        replace(p, name=f"{folders[id(p)].name}/{p.name}") if names.count(p.name) > 1 else p for p in parts
    ]
