"""Draw parts and sketches to learn from, and keep their strips and views in files::

    python -m recognition.learning.draw_data FONTS ... --out DATA --parts 9000 --sketches 30000 --held-out 200 --jobs 2

FONTS are folders. DATA then has `strips/seen`, `strips/sketched`, `strips/held`, `views/seen` and `views/held`, a file
for every `PARTS_OF_A_FILE` parts or lines. What is there already is not drawn again. A process draws some three parts
(16 strips) or 25 sketched lines (75 strips) a second.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glyphs.errors import MarksError
from recognition.learning.sketches import sketch_many
from recognition.learning.training_fonts import find_fonts
from recognition.learning.training_parts import draw_part
from recognition.learning.training_samples import (
    TrainingStrip,
    TrainingView,
    strips_of,
    training_views,
    write_samples,
)

PARTS_OF_A_FILE = 48
_log = logging.getLogger(__name__)


def draw_parts(fonts: Sequence[Path], out: Path, kind: str, name: str, rng: np.random.Generator) -> None:
    """Draw the parts of one file of strips and one of views.

    Args:
        fonts: to choose from.
        out: folder of the data.
        kind: "seen" or "held".
        name: of the file.
        rng: the only source of randomness.
    """
    strips: list[TrainingStrip] = []
    views: list[TrainingView] = []
    for k in range(PARTS_OF_A_FILE):
        try:
            made = draw_part(fonts, rng)
            own, seen = strips_of(made), training_views(made)
        except (MarksError, ValueError) as error:  # drawn at random, some things cannot be
            _log.info("part %d of %s: %s", k, name, error)
            continue
        strips += own
        views += [seen[0], seen[1], seen[-1]][k % 2 :: 2]
    write_samples(out / "strips" / kind / name, strips)
    write_samples(out / "views" / kind / name, views)


def draw_file(
    fonts: Sequence[Path], out: Path, kind: str, seed: int, number: int, *, fonts_of_a_file: int = 16
) -> None:
    """Draw a file of strips, and for parts one of views, unless the last of them is there.

    Args:
        fonts: to choose from.
        out: folder of the data.
        kind: "seen" or "held" of parts, "sketched" of lines without physics.
        seed: of the whole set.
        number: of the file.
        fonts_of_a_file: fonts whose outlines are drawn for a file: each costs more than a part.
    """
    name, sketched = f"{seed:03d}-{number:05d}.npz", kind == "sketched"
    if (out / ("strips" if sketched else "views") / kind / name).exists():
        return
    rng = np.random.default_rng((seed, number, 1) if sketched else (seed, number))
    few = [fonts[i] for i in rng.integers(len(fonts), size=fonts_of_a_file)]
    if sketched:
        write_samples(out / "strips" / kind / name, sketch_many(few, PARTS_OF_A_FILE, rng))
    else:
        draw_parts(few, out, kind, name, rng)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw what the command line asks for."""
    from joblib import Parallel, delayed

    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("fonts", type=Path, nargs="+", help="folders of TrueType or OpenType files")
    asked.add_argument("--out", type=Path, required=True, help="folder of the data")
    asked.add_argument("--parts", type=int, default=9000, help="of fonts to learn from")
    asked.add_argument("--sketches", type=int, default=30000, help="lines without physics")
    asked.add_argument("--held-out", type=int, default=200, help="parts of fonts that are never learned from")
    asked.add_argument("--seed", type=int, default=70)
    asked.add_argument("--jobs", type=int, default=1, help="processes")
    given = asked.parse_args(arguments)
    fonts = find_fonts(given.fonts)
    kinds = (
        ("held", fonts.held_out, given.held_out),
        ("seen", fonts.seen, given.parts),
        ("sketched", fonts.seen, given.sketches),
    )
    Parallel(n_jobs=given.jobs, verbose=5)(
        delayed(draw_file)(files, given.out, kind, given.seed, number)
        for kind, files, parts in kinds
        for number in range(-(-parts // PARTS_OF_A_FILE))
    )


if __name__ == "__main__":
    main()
