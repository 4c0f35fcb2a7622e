"""Read parts of a second generator, and keep the readings as a benchmark does::

    python tests/benchmarks/sketched_parts.py FONTS ... --parts 240 --out sketched

FONTS are folders; of their fonts those are used that the recogniser never learns from. Marks, plates and soils are
the sketches of `recognition.learning.sketches`, which share no code with the generator of parts; the whiskers feel
them by the same contact. A score that is to hold on parts of any kind is judged by them as well
(`tests/benchmarks/fit_score.py`).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.fonts.serials import random_text
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.trials.journal import Trial, TrialJournal, answer_of
from recognition.decision.evidence import measures_of
from recognition.learning.sketches import SketchedPart, sketch_part
from recognition.learning.training_fonts import find_fonts
from recognition.reader import Reader

FORMAT = "AA999999"
HEIGHTS_MM = (2.0, 12.0)


def part_of(made: SketchedPart, height_mm: float) -> tuple[HeightMap, Photo]:
    """A sketch as a height map and a photograph of the same scale."""
    pitch_mm = height_mm / made.rows_per_height
    surface = HeightMap((made.surface * height_mm).astype(np.float32), pitch_mm)
    return surface, Photo(made.picture, pitch_mm=pitch_mm)


def main(arguments: Sequence[str] | None = None) -> None:
    """Sketch, read, and keep."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("fonts", type=Path, nargs="+", help="folders of TrueType or OpenType files")
    asked.add_argument("--parts", type=int, default=240)
    asked.add_argument("--seed", type=int, default=5151)
    asked.add_argument("--out", type=Path, required=True, help="folder of the readings")
    given = asked.parse_args(arguments)
    fonts, reader = find_fonts(given.fonts).held_out, Reader(format=FORMAT)
    journal = TrialJournal.open(given.out, {"parts": {"name": "sketched"}})
    for k in range(given.parts):
        rng = np.random.default_rng((given.seed, k))
        text = random_text(FORMAT, rng=rng)
        try:
            made = sketch_part([fonts[int(rng.integers(len(fonts)))]], rng, text=text)
        except (MarksError, ValueError):  # a font that lacks a character
            continue
        height_mm = float(np.exp(rng.uniform(*np.log(HEIGHTS_MM))))
        surface, photo = part_of(made, height_mm)
        touch, vision = reader.touch.read_height_map(surface), reader.vision.read_photo(photo)
        levels = {"soil": "sketched", "font": made.font, "severity": made.severity, "height_mm": height_mm}
        name = f"sketched-{k:04d}"
        trials = [
            Trial(
                name, k, levels, mode, text, **answer_of(reading),
                measures={one.value: value for one, value in measures_of(reading).items()},
            )
            for mode, reading in (("tactile", touch), ("vision", vision), ("fused", reader.fuse(touch, vision)))
        ]  # fmt: skip
        journal.keep(name, tuple(trials))
    journal.close()


if __name__ == "__main__":
    main()
