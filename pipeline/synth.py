"""Parts out of nothing: stamped plates and the table of what was stamped on them.

The truth stands in `truth.csv` alone; no part's own file tells its text. A part depends on the seed and its
number only, so the first ten of fifty are the same as ten.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glyphs.die import Die, Face, default_die
from glyphs.outlines import Font, load_font
from glyphs.serials import allowed_characters, random_text
from glyphs.stamping import StampedPart, StampingVariation, stamp
from pipeline.atomic import replacing
from pipeline.npz import write_npz
from pipeline.problems import FileProblem

TRUTH_FILE = "truth.csv"
MAX_PARTS = 1_000_000


@dataclass(frozen=True)
class SynthSpec:
    """What to stamp.

    Attributes:
        mask: format of the serials.
        font: built-in name or font file.
        seed: of everything random.
        height_mm: character height.
        depth_mm: depth of the mark, from the table of usual depths unless given.
        face: face of the die.
        bevel_deg: slope of its walls.
        raised: raised marks.
        variation: whether blows and plate differ as they do in a shop; without it all is ideal.

    Raises:
        ValueError: a mask, font or die that cannot be.
    """

    mask: str
    font: str = "gothic"
    seed: int = 0
    height_mm: float = 5.0
    depth_mm: float | None = None
    face: Face = Face.FLAT
    bevel_deg: float = 45.0
    raised: bool = False
    variation: bool = True

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; it cannot be negative")
        allowed_characters(self.mask)
        self.die(load_font(self.font))

    def die(self, font: Font) -> Die:
        """The die that stamps them."""
        return default_die(
            self.height_mm, font=font, face=self.face, bevel_deg=self.bevel_deg, depth_mm=self.depth_mm
        )


def make_part(spec: SynthSpec, number: int) -> StampedPart:
    """The part of that number, the same whatever was made before it."""
    rng = np.random.default_rng([spec.seed, number])
    font = load_font(spec.font)
    return stamp(
        random_text(spec.mask, rng=rng),
        font,
        spec.die(font),
        height_mm=spec.height_mm,
        variation=StampingVariation() if spec.variation else StampingVariation.none(),
        raised=spec.raised,
        rng=rng,
    )


def write_parts(
    spec: SynthSpec,
    folder: Path,
    *,
    parts: int,
    overwrite: bool = False,
    on_part: Callable[[str], None] | None = None,
) -> list[tuple[str, str]]:
    """Write the parts as `.npz` and the truth as `truth.csv`.

    Returns:
        (name, text) of each part.

    Raises:
        FileProblem: the folder is not empty and not to be overwritten, or cannot be written.
        ValueError: a number of parts that cannot be.
    """
    if not 1 <= parts <= MAX_PARTS:
        raise ValueError(f"the number of parts is {parts}; it lies between 1 and {MAX_PARTS:,}")
    _prepare(folder, overwrite=overwrite)
    digits = max(3, len(str(parts - 1)))
    truth = []
    for number in range(parts):
        name = f"part-{number:0{digits}d}"
        part = make_part(spec, number)
        write_npz(folder / f"{name}.npz", part.height_map)
        truth.append((name, part.text))
        if on_part is not None:
            on_part(name)
    with (
        replacing(folder / TRUTH_FILE) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as stream,
    ):
        writer = csv.writer(stream)
        writer.writerow(("part", "text"))
        writer.writerows(truth)
    return truth


def _prepare(folder: Path, *, overwrite: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()) and not overwrite:
            raise FileProblem(folder, "is not empty", "name another folder or give --overwrite")
    except OSError as error:
        raise FileProblem(folder, f"cannot be made ({error.strerror})", "name another folder") from error
