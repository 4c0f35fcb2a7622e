"""How exactly depths are felt: less the truth of the stamped marks, by the die's face, their height and the dirt.

Run `python tests/benchmarks/depth_accuracy.py [--parts N]`; the font is gothic and named. Under dirt the truth is still
that of the clean mark, so what fills a stroke counts as a bias.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import random_text
from glyphs.part import stamp
from glyphs.stamping.faces import Face
from glyphs.stamping.stamp import StampedPart
from glyphs.stamping.variation import StampingVariation
from recognition.reader import Reader

HEIGHTS_MM = (3.2, 5.0, 7.0, 12.7)
SEVERITIES = (0.0, 0.3, 0.6, 0.9)
FORMAT = "AA999999"


def true_depths_mm(part: StampedPart) -> NDArray[np.float64]:
    """(characters,) depth of the deepest sample of each box before any dirt: a floor, or the bottom of a V."""
    z, pitch = part.height_map.z_mm, part.height_map.pitch_mm
    corners = (np.array(part.boxes_mm) / pitch).astype(np.intp)
    return np.array([-z[y0 : y1 + 2, x0 : x1 + 2].min() for x0, y0, x1, y1 in corners])


def errors_mm(
    reader: Reader, face: Face, height_mm: float, severity: float, parts: int
) -> Iterator[tuple[float, float, float]]:
    """Mean depth less the truth, mm, least to mean depth, and share of strokes felt of each character read right."""
    for k in range(parts):
        seed = (23, k, round(10 * height_mm))
        part = stamp(
            random_text(FORMAT, rng=np.random.default_rng(seed)),
            fonts="gothic",
            height_mm=height_mm,
            face=face,
            variation=StampingVariation.none(),
            dirt=severity,
            seed=seed,
        )
        reading = reader.read(part.height_map, soil=part.soil)
        truths_mm = true_depths_mm(part.stamped)
        for c, place, true_mm, char in zip(
            reading.characters, reading.trace.strokes, truths_mm, part.text, strict=False
        ):
            if c.char == char and c.depth is not None and place.felt is not None:
                yield c.depth.mean_mm - true_mm, c.depth.min_mm / max(c.depth.mean_mm, 1e-9), place.felt


def main(*, parts: int = 4) -> None:
    """Print a row for each face, height and severity."""
    reader = Reader(fonts=["gothic"], format=FORMAT)
    print(
        "| face | height, mm | dirt | characters | mean depth less the truth, µm | least to mean | strokes felt |"
    )
    print("|---|---|---|---|---|---|---|")
    for face in (Face.FLAT, Face.ROUND, Face.SHARP):
        for height_mm in HEIGHTS_MM:
            for severity in SEVERITIES:
                found = np.array(list(errors_mm(reader, face, height_mm, severity, parts)))
                error, least, felt = found.T if len(found) else np.full((3, 1), np.nan)
                um = f"{1e3 * error.mean():+.1f} ± {1e3 * error.std():.1f}"
                row = (face, height_mm, severity, len(found), um, f"{least.mean():.2f}", f"{felt.mean():.3f}")
                print(f"| {' | '.join(map(str, row))} |", flush=True)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
