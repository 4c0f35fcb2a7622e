"""A hash of each of an edition's parts: whether another machine, or a changed program, makes the same.

    design --make--> heights, what yields, photograph, truth --rounded--> sha256, twelve digits a part

`python tests/benchmarks/edition_digest.py NAME` makes the parts that its file in `digests` lists, and says
which differ; `--write` lists them anew.

Heights are rounded to a tenth of a micrometre before they are hashed. A machine whose arithmetic differs in the last
bit can still have a sample on the other side of a rounding edge, so its hash differs where its parts do not matter.
With numpy's wide instructions switched off, 13 (AVX2 left) or 8 (not even that) of 48 parts hash the same, and no
sample of the others is more than one step away: a tenth of a micrometre, one of 255 shades of grey.
"""

from __future__ import annotations

import hashlib
import sys
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError
from pipeline.benchmark.exam.design import design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Item, Specimen
from pipeline.workers.executors import ordered_map
from pipeline.workers.pool import WorkPool

DIGITS: Final = 12
"""Digits of the hash in the file: a part that differs by chance is missed once in 2^48."""
STEPS: Final = {"z_mm": 1e-4, "soft_mm": 1e-4, "friction": 1e-3, "hardness_mpa": 1e-2}
"""Steps to which heights (a tenth of a micrometre) and soil are rounded."""
Arrays = dict[str, NDArray[Any]]


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


def digest_of(edition: str, part: str) -> str:
    """Make one part of an edition, and hash it."""
    parts, items = parts_of(edition)
    specimen = parts.make(items[part])
    return digest(rounded(specimen), specimen.truth)


@cache
def parts_of(edition: str) -> tuple[DesignedParts, dict[str, Item]]:
    """The parts of an edition, and its items by name."""
    parts = DesignedParts(design_named(edition))
    return parts, {item.part: item for item in parts.items()}


def digests_file(edition: str) -> Path:
    """The file with the digests of an edition."""
    return Path(__file__).parent / "digests" / f"{edition}.digests"


def arithmetic() -> str:
    """Parts of the machine that a digest depends on: numpy, and the instructions that it found here."""
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


def main(edition: str, *, jobs: int = 2, every: int = 1, write: bool = False) -> None:
    """Make the parts of an edition again, and say which differ.

    Args:
        edition: its name.
        jobs: processes.
        every: with --write: list the first part and every so many after it.
        write: list them anew.
    """
    path, items = digests_file(edition), parts_of(edition)[1]
    names = list(items)[::every] if write else [name for name in listed(path) if name in items]
    with WorkPool(jobs) as pool:
        found = dict(zip(names, ordered_map(pool, partial(digest_of, edition), names), strict=True))
    if write:
        heading = f"# {edition}: part and digest, every {every} of {len(items)} parts\n# {arithmetic()}\n"
        lines = "".join(f"{part} {made}\n" for part, made in found.items())
        path.write_text(heading + lines, encoding="utf-8")
        print(f"{path.name}: {len(found)} parts listed")
        return
    known = listed(path)
    differ = [part for part in known if known[part] != found.get(part)]
    for part in differ:
        print(f"{part}: {found.get(part, 'not a part of this edition')}, listed as {known[part]}")
    if differ and listed_with(path) != arithmetic():
        print(f"listed with {listed_with(path)}; this is {arithmetic()}")
    print(f"{edition}: {len(known) - len(differ)} of {len(known)} listed parts are the same")
    if differ:
        sys.exit(1)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
