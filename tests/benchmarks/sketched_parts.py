"""Read parts of the second generator with its own dirt and camera, and keep the readings as a benchmark does::

    python tests/benchmarks/sketched_parts.py FONTS ... --parts 240 --out sketched

FONTS are folders; of their fonts those are used that the recogniser never learns from. Marks and plates are those of
`glyphs.sketch`, dirt and photographs those of `recognition.learning.sketches`; the whiskers feel them by the same
contact. A score that is to hold on parts of any kind is judged by them as well (`tests/benchmarks/fit_score.py`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.fonts.serials import random_text
from glyphs.sketch import ROWS_PER_HEIGHT, sketch
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from recognition.learning.sketches import photograph
from recognition.learning.training_fonts import find_fonts
from recognition.reader import Reader
from recognition.views.view import GREY

FORMAT = "AA999999"
HEIGHTS_MM = (2.0, 12.0)


def main(*folders: Path, parts: int = 240, seed: int = 5151, out: Path) -> None:
    """Sketch, read, and keep.

    Args:
        folders: of TrueType or OpenType files.
        parts: how many.
        seed: of the parts.
        out: folder of the readings.
    """
    fonts, reader = find_fonts(folders).held_out, Reader(format=FORMAT)
    journal = TrialJournal(out, {"parts": {"name": "sketched"}})
    for k in range(parts):
        rng = np.random.default_rng((seed, k))
        text = random_text(FORMAT, rng=rng)
        font = fonts[int(rng.integers(len(fonts)))]
        if rng.random() < 0.2:
            font = Path(str(rng.choice(BUILTIN_FONTS)))
        try:
            made = sketch(load_font(str(font)), text, rng)
        except (MarksError, ValueError):  # a font that lacks a character
            continue
        grey = np.kron(photograph(made, rng)[GREY], np.ones((2, 2)))
        height_mm = float(np.exp(rng.uniform(*np.log(HEIGHTS_MM))))
        pitch_mm, land = height_mm / ROWS_PER_HEIGHT, ROWS_PER_HEIGHT // 2
        z_mm = np.pad(made.surface, ((land, land), (0, 0)), mode="edge") * np.float32(height_mm)
        touch = reader.read(HeightMap(z_mm, pitch_mm))
        pixels = np.asarray(np.clip(255.0 * grey, 0.0, 255.0), dtype=np.uint8)
        vision = reader.read(Photo(pixels, pitch_mm=pitch_mm))
        levels = {"soil": "sketched", "font": font.name, "severity": made.severity, "height_mm": height_mm}
        name = f"sketched-{k:04d}"
        trials = [
            Trial(
                name, k, levels, mode, text, **answer_of(reading),
                measures={one.value: value for one, value in reading.measures.items()},
            )
            for mode, reading in (("tactile", touch), ("vision", vision), ("fused", reader.fuse(touch, vision)))
        ]  # fmt: skip
        journal.keep(name, tuple(trials))
    journal.close()


if __name__ == "__main__":
    from cyclopts import run

    run(main)
