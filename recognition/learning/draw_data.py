"""Draw random parts and sketches for training, and write their strips and views to files::

    python -m recognition.learning.draw_data FONTS ... --out DATA --parts 9000 --sketches 30000 --held-out 200 --jobs 2

DATA then has `strips/seen`, `strips/sketched`, `strips/held`, `views/seen` and `views/held`. Existing files are not
drawn again. A process draws some three parts or 25 sketched lines a second.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from cyclopts import run

from glyphs.errors import MarksError
from recognition.learning.sketches import sketch_strips
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


def draw_file(
    fonts: Sequence[Path], out: Path, kind: str, seed: int, number: int, *, fonts_of_a_file: int = 16
) -> None:
    """Draw a file of strips, and of views for parts ("seen", "held"; "sketched" has none), unless the last exists."""
    name, sketched = f"{seed:03d}-{number:05d}.npz", kind == "sketched"
    if (out / ("strips" if sketched else "views") / kind / name).exists():
        return
    rng = np.random.default_rng((seed, number, 1) if sketched else (seed, number))
    # loading the outlines of a font takes longer than drawing a part
    few = [fonts[i] for i in rng.integers(len(fonts), size=fonts_of_a_file)]
    strips: list[TrainingStrip] = []
    views: list[TrainingView] = []
    for k in range(PARTS_OF_A_FILE):
        try:
            if sketched:
                strips += sketch_strips(few, rng)
                continue
            part = draw_part(few, rng)
            strips_of_part, seen = strips_of(part), training_views(part)
        except (MarksError, ValueError) as error:  # some random draws are impossible
            _log.info("%d of %s: %s", k, name, error)
            continue
        strips += strips_of_part
        views += [seen[0], seen[1], seen[-1]][k % 2 :: 2]
    write_samples(out / "strips" / kind / name, strips)
    if views:
        write_samples(out / "views" / kind / name, views)


def draw_data(
    fonts: list[Path],
    /,
    *,
    out: Path,
    parts: int = 9000,
    sketches: int = 30000,
    held_out: int = 200,
    seed: int = 70,
    jobs: int = 1,
) -> None:
    """Draw samples to learn from, and samples to measure on.

    Args:
        fonts: folders of TrueType or OpenType files.
        out: folder of the data.
        parts: number of parts with fonts to learn from.
        sketches: number of lines without physics.
        held_out: number of parts with fonts that are never learned from.
        seed: seed of the whole set.
        jobs: number of processes.
    """
    from joblib import Parallel, delayed

    available = find_fonts(fonts)
    held = _files("held", held_out)
    # parts and sketches in turn, so that training can begin with both
    learned = sorted((*_files("seen", parts), *_files("sketched", sketches)), key=lambda file: file[2])
    Parallel(n_jobs=jobs, verbose=5)(
        delayed(draw_file)(available.held_out if kind == "held" else available.seen, out, kind, seed, number)
        for kind, number, _ in (*held, *learned)
    )


def _files(kind: str, parts: int) -> list[tuple[str, int, float]]:
    count = -(-parts // PARTS_OF_A_FILE)
    return [(kind, number, number / count) for number in range(count)]


if __name__ == "__main__":
    run(draw_data)
