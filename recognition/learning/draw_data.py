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
from recognition.learning.training_strips import TrainingStrip, strips_of, write_strips
from recognition.learning.training_views import TrainingView, training_views, write_views

PARTS_OF_A_FILE = 48
FONTS_OF_A_FILE = 16
"""Fonts whose outlines are drawn for a file: each costs more than a part."""
_log = logging.getLogger(__name__)


def draw_file(fonts: Sequence[Path], out: Path, kind: str, seed: int, number: int) -> int:
    """Draw the parts of one file of strips and one of views; the number of parts that were drawn.

    Args:
        fonts: to choose from.
        out: folder of the data.
        kind: "seen" or "held".
        seed: of the whole set.
        number: of the file.
    """
    name = f"{seed:03d}-{number:05d}.npz"
    strips_at, views_at = (out / what / kind / name for what in ("strips", "views"))
    if views_at.exists():
        return 0
    rng = np.random.default_rng((seed, number))
    few = [fonts[i] for i in rng.integers(len(fonts), size=FONTS_OF_A_FILE)]
    strips: list[TrainingStrip] = []
    views: list[TrainingView] = []
    drawn = 0
    for k in range(PARTS_OF_A_FILE):
        try:
            made = draw_part(few, rng)
            strips += strips_of(made)
            seen = training_views(made)
        except (MarksError, ValueError) as error:  # drawn at random, some things cannot be
            _log.info("part %d of %s: %s", k, name, error)
            continue
        views += [seen[0], seen[1], seen[-1]][k % 2 :: 2]
        drawn += 1
    for path in (strips_at, views_at):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_strips(strips_at.with_suffix(".tmp.npz"), strips)
    write_views(views_at.with_suffix(".tmp.npz"), views)
    strips_at.with_suffix(".tmp.npz").rename(strips_at)
    views_at.with_suffix(".tmp.npz").rename(views_at)
    return drawn


def draw_sketches(fonts: Sequence[Path], out: Path, seed: int, number: int) -> int:
    """Draw the lines of one file of sketched strips; the number of lines that were drawn.

    Args:
        fonts: to choose from.
        out: folder of the data.
        seed: of the whole set.
        number: of the file.
    """
    path = out / "strips" / "sketched" / f"{seed:03d}-{number:05d}.npz"
    if path.exists():
        return 0
    rng = np.random.default_rng((seed, number, 1))
    few = [fonts[i] for i in rng.integers(len(fonts), size=FONTS_OF_A_FILE)]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_strips(path.with_suffix(".tmp.npz"), sketch_many(few, PARTS_OF_A_FILE, rng))
    path.with_suffix(".tmp.npz").rename(path)
    return PARTS_OF_A_FILE


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
    tasks = [
        (files, given.out, kind, given.seed, number)
        for kind, files, parts in (
            ("held", fonts.held_out, given.held_out),
            ("seen", fonts.seen, given.parts),
        )
        for number in range(-(-parts // PARTS_OF_A_FILE))
    ]
    sketches = range(-(-given.sketches // PARTS_OF_A_FILE))
    Parallel(n_jobs=given.jobs, verbose=5)(
        [delayed(draw_file)(*task) for task in tasks]
        + [delayed(draw_sketches)(fonts.seen, given.out, given.seed, number) for number in sketches]
    )


if __name__ == "__main__":
    main()
