"""What an edition's parts are, in a hash each: whether another machine makes the same.

    design --make--> heights, what yields, photograph, truth --rounded--> sha256, twelve digits a part

`python tests/benchmarks/edition_digest.py NAME` makes the parts that its file in `digests` lists, and says
which differ; `--write` lists them anew. How far parts of two machines, or of two programs, differ is found with
`--keep FOLDER` on the one and `--against FOLDER` on the other.

Heights are rounded to a tenth of a micrometre before they are hashed. A machine whose arithmetic differs in the last
bit can still have a sample on the other side of a rounding edge, so its hash differs where its parts do not matter:
then the folder tells by how much. With numpy's wide instructions switched off, 13 (AVX2 left) or 8 (not even that) of
48 parts hash the same, and no sample of the others is more than one step away: a tenth of a micrometre, one of 255
shades of grey.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.editions import design_named
from pipeline.benchmark.exam.specimens import Item, Specimen
from pipeline.workers.executors import ordered_map
from pipeline.workers.pool import WorkPool

DIGITS: Final = 12
"""Of the hash, in the file: a part that differs by chance is missed once in 2^48."""
STEPS: Final = {"z_mm": 1e-4, "soft_mm": 1e-4, "friction": 1e-3, "hardness_mpa": 1e-2}
"""To what heights (a tenth of a micrometre) and soil are rounded."""
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Task:
    """One part to be made.

    Attributes:
        edition: name of the design.
        number: of the part among those of the design.
        keep: folder that its arrays are written to.
        against: folder with the arrays that it is compared with.
    """

    edition: str
    number: int
    keep: Path | None = None
    against: Path | None = None


@dataclass(frozen=True)
class Made:
    """A part as it was made.

    Attributes:
        part: its name.
        digest: of all that it is.
        apart: largest difference of each array from that of the other folder, in its own unit; infinite where it has
            another shape.
    """

    part: str
    digest: str
    apart: Mapping[str, float]


def rounded(specimen: Specimen) -> Arrays:
    """All that a part is, as integers: heights and soil in `STEPS`, the photograph's pixels."""
    floats = {"z_mm": specimen.height_map.z_mm}
    if specimen.soil is not None:
        floats["soft_mm"] = specimen.soil.thickness_mm
        floats["friction"] = specimen.soil.friction
        floats["hardness_mpa"] = specimen.soil.hardness_mpa
    arrays: Arrays = {
        name: np.rint(values.astype(np.float64) / STEPS[name]).astype(np.int32)
        for name, values in floats.items()
    }
    if specimen.take_photo is not None:
        arrays["pixels"] = specimen.take_photo().pixels
    return arrays


def digest(arrays: Arrays, truth: str) -> str:
    """The first digits of the hash of a part."""
    found = hashlib.sha256(truth.encode())
    for name, values in sorted(arrays.items()):
        found.update(f"{name} {values.shape} {values.dtype.str}".encode())
        found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()[:DIGITS]


def made(task: Task) -> Made:
    """Make one part."""
    parts, items = _parts(task.edition)
    specimen = parts.make(items[task.number])
    arrays = rounded(specimen)
    if task.keep is not None:
        np.savez_compressed(task.keep / f"{specimen.part}.npz", allow_pickle=False, **arrays)
    apart = _apart(arrays, task.against / f"{specimen.part}.npz") if task.against is not None else {}
    return Made(specimen.part, digest(arrays, specimen.truth), apart)


@cache
def _parts(edition: str) -> tuple[DesignedParts, list[Item]]:
    parts = DesignedParts(design_named(edition))
    return parts, parts.items()


def _apart(arrays: Arrays, path: Path) -> dict[str, float]:
    apart = {}
    with np.load(path) as other:
        for name in sorted({*arrays, *other}):
            if name not in arrays or name not in other or arrays[name].shape != other[name].shape:
                apart[name] = float("inf")
                continue
            steps = np.abs(arrays[name].astype(np.int64) - other[name].astype(np.int64)).max()
            apart[name] = float(steps) * STEPS.get(name, 1.0)
    return apart


def digests_file(edition: str) -> Path:
    """Where the digests of an edition are."""
    return Path(__file__).parent / "digests" / f"{edition}.digests"


def arithmetic() -> str:
    """What a digest hangs on besides the program: numpy, and the instructions that it found here."""
    found: list[str] = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    return " ".join(["numpy", np.__version__, *found])


def listed_with(path: Path) -> str:
    """The `arithmetic` that a list was made with."""
    return path.read_text(encoding="utf-8").splitlines()[1].removeprefix("# ")


def listed(path: Path) -> dict[str, str]:
    """Digest of each part that is listed.

    Raises:
        FileError: there is no list.
    """
    if not path.is_file():
        raise FileError(path, "is not there", "list the parts with --write")
    lines = path.read_text(encoding="utf-8").splitlines()
    cut = (line.partition(" ") for line in lines if not line.startswith("#"))
    return {part: found for part, _, found in cut}


def main(
    edition: str,
    *,
    jobs: int = 2,
    every: int = 1,
    write: bool = False,
    keep: Path | None = None,
    against: Path | None = None,
) -> None:
    """Make the parts of an edition again, and say which differ.

    Args:
        edition: its name.
        jobs: processes.
        every: with --write: list the first part and every so many after it.
        write: list them anew.
        keep: folder for what was made.
        against: such a folder, of another machine or program: by how much parts differ.
    """
    path = digests_file(edition)
    items = _parts(edition)[1]
    known = {} if write else listed(path)
    numbers = [k for k, item in enumerate(items) if (k % every == 0 if write else item.part in known)]
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    with WorkPool(jobs) as pool:
        found = list(ordered_map(pool, made, [Task(edition, k, keep, against) for k in numbers]))
    if write:
        heading = f"# {edition}: part and digest, every {every} of {len(items)} parts\n# {arithmetic()}\n"
        path.write_text(heading + "".join(f"{m.part} {m.digest}\n" for m in found), encoding="utf-8")
        print(f"{path.name}: {len(found)} parts listed")
        return
    differ = [m for m in found if known[m.part] != m.digest]
    for m in differ:
        print(f"{m.part}: {m.digest}, listed as {known[m.part]}")
    if differ and listed_with(path) != arithmetic():
        print(
            f"listed with {listed_with(path)}; this is {arithmetic()}: --against says whether they are far apart"
        )
    print(f"{edition}: {len(found) - len(differ)} of {len(found)} listed parts are the same")
    missing = sorted(set(known) - {m.part for m in found})
    for part in missing:
        print(f"{part}: listed, and not a part of this edition")
    if against is not None:
        print("differences at most:", _most(m.apart for m in found))
    if differ or missing:
        sys.exit(1)


def _most(apart: Iterable[Mapping[str, float]]) -> str:
    most: dict[str, float] = {}
    for each in apart:
        for name, value in each.items():
            most[name] = max(value, most.get(name, 0.0))
    return ", ".join(f"{name} {value:g}" for name, value in most.items())


if __name__ == "__main__":
    from cyclopts import run

    run(main)
