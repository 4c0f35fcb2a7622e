"""How much reviewed parts teach: an unknown die, a worn one, and whether other parts suffer.

    python tests/benchmarks/learning.py [--parts 24] [--cases unknown worn harm harm-dirty] [--steps 0 5 10 20]

Parts that are read are never among those that are enrolled: their numbers begin at 1000, the enrolled ones at 0.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rapidfuzz.distance import Levenshtein

from glyphs.fonts.outlines import load_font
from glyphs.soiling.soil import Soil
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.faces import default_die
from glyphs.stamping.plate import plate_form, plate_texture
from glyphs.stamping.stamp import stamp_line
from glyphs.stamping.variation import PlateVariation, StampingVariation
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import ReadSettings
from pipeline.formats.npz import write_npz
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.reading.enrolment import ReviewedPart, enrol
from recognition.decision.decide import Decision
from recognition.reader import Reader
from recognition.senses.settings import ReaderSettings

FORMAT = "AA999999"
HELD_OUT = 1000
Made = tuple[str, HeightMap, Soil | None]


def dejavu_bold() -> str:
    """A font that is none of the built-in ones, of the plotting library's data."""
    import matplotlib

    return f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans-Bold.ttf"


def unknown(number: int) -> Made:
    """A part stamped with a die of another make."""
    part = make_part(SynthSpec(format=FORMAT, font=dejavu_bold(), seed=100), number)
    return part.text, part.height_map, None


def worn(number: int) -> Made:
    """A part of a worn gothic die: a third as deep, rounded by 0.08 of the height, corners broken off."""
    from scipy.ndimage import gaussian_filter

    spec = SynthSpec(format=FORMAT, seed=200)
    font = load_font("gothic")
    die = default_die(spec.height_mm, font=font, depth_mm=0.07)
    rng = np.random.default_rng([spec.seed, number])
    flat = StampingVariation(plate=PlateVariation.none())
    part = stamp_line(
        make_part(spec, number).text, font, die, height_mm=spec.height_mm, variation=flat, rng=rng
    )
    pitch = part.height_map.pitch_mm
    z = np.array(part.height_map.z_mm)
    for char, (x0, y0, x1, y1) in zip(part.text, part.boxes_mm, strict=True):
        if char in BROKEN:
            left, top = BROKEN[char]
            cols = np.array([x0 + left * (x1 - x0), x0 + (left + 0.45) * (x1 - x0)]) / pitch
            rows = np.array([y0 + top * (y1 - y0), y0 + (top + 0.5) * (y1 - y0)]) / pitch
            z[slice(*rows.astype(int)), slice(*cols.astype(int))] = 0.0
    z = gaussian_filter(z, 0.08 * spec.height_mm / pitch)
    x, y = (np.arange(n) * pitch for n in z.shape[::-1])
    plate = PlateVariation()
    z = z + plate_form(x, y, plate, rng=rng) + plate_texture(x, y, plate, rng=rng)
    return part.text, HeightMap(z, pitch), None


BROKEN = {"8": (-0.05, 0.55), "3": (0.6, 0.0), "B": (0.6, 0.5), "E": (0.6, -0.05)}
"""Corner of the box that is missing: from the left and from the top, shares of the box."""


def harm(number: int) -> Made:
    """A clean part of the usual gothic."""
    part = make_part(SynthSpec(format=FORMAT, seed=300), number)
    return part.text, part.height_map, None


def harm_dirty(number: int) -> Made:
    """A dirty part of the usual gothic."""
    part = make_part(SynthSpec(format=FORMAT, seed=300, soiling=Soiling(severity=0.6)), number)
    return part.text, part.height_map, part.soil


CASES: dict[str, tuple[Callable[[int], Made], Callable[[int], Made]]] = {
    "unknown": (unknown, unknown),
    "worn": (worn, worn),
    "harm": (unknown, harm),
    "harm-dirty": (unknown, harm_dirty),
}
"""What is enrolled, and what is read."""


@dataclass(frozen=True)
class Score:
    """What came of some parts."""

    parts: int
    characters: float
    serials: float
    accepted: float
    accepted_wrong: int

    def __str__(self) -> str:
        return (
            f"characters {self.characters:6.1%}  serials {self.serials:6.1%}  accepted {self.accepted:6.1%}  "
            f"accepted wrong {self.accepted_wrong}  n {self.parts}"
        )


def read_all(reader: Reader, parts: Sequence[Made]) -> Score:
    """Read the parts and hold them against what was stamped."""
    edits = right = accepted = wrong = 0
    for text, height_map, soil in parts:
        reading = reader.read(height_map, soil=soil)
        distance = Levenshtein.distance(text, "".join(reading.text.split()))
        edits += distance
        right += distance == 0
        accepted += reading.decision is Decision.ACCEPT
        wrong += reading.decision is Decision.ACCEPT and distance > 0
    n = len(parts)
    return Score(n, 1 - edits / (len(FORMAT) * n), right / n, accepted / n, wrong)


def taught(parts: Sequence[Made], folder: Path, *, step: int, font: str) -> Path:
    """A database that the first parts were enrolled into."""
    database = folder / f"{font}-{step}.glyphs"
    reviewed = []
    for k, (text, height_map, _) in enumerate(parts[:step]):
        file = folder / f"{font}-{k}.npz"
        if not file.exists():
            write_npz(file, height_map)
        reviewed.append(ReviewedPart(file.stem, text, height_map=file))
    report = enrol(reviewed, database, font=font, settings=ReadSettings())
    print(f"  {report.describe()}".replace("\n", "\n  "), flush=True)
    return database


def run(case: str, *, parts: int, steps: Sequence[int], formats: Sequence[str | None]) -> None:
    """Print the table of one case."""
    from glyphs.stamping.database import load_database

    teach, test = CASES[case]
    held_out = [test(HELD_OUT + k) for k in range(parts)]
    to_enrol = [teach(k) for k in range(max(steps))]
    with tempfile.TemporaryDirectory() as folder:
        for step in steps:
            fonts = ()
            if step:
                database = taught(to_enrol, Path(folder), step=step, font="press-7")
                fonts = tuple(load_database(database).fonts.values())
            for format in formats:
                score = read_all(Reader(ReaderSettings(format=format, fonts=fonts)), held_out)
                print(f"{case:<11} enrolled {step:2d}  {format or 'no format':<9}  {score}", flush=True)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", type=int, default=24)
    parser.add_argument("--cases", nargs="+", choices=sorted(CASES), default=list(CASES))
    parser.add_argument("--steps", nargs="+", type=int, default=[0, 5, 10, 20])
    parser.add_argument("--format", nargs="+", default=[FORMAT, ""], help="formats; '' is no format")
    options = parser.parse_args()
    for case in options.cases:
        run(case, parts=options.parts, steps=options.steps, formats=[m or None for m in options.format])


if __name__ == "__main__":
    main()
