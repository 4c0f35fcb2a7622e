"""Draw parts of four generators once, and read them with every sense as often as the reader changes::

    python tests/benchmarks/risk_parts.py draw FONTS OTHER_GENERATORS --out drawn --first 0 --step 2
    python tests/benchmarks/risk_parts.py read drawn --out readings

FONTS is a folder of font files that the recogniser has not learned from; OTHER_GENERATORS holds `make_parts.py` and
`make_parts2.py`. Drawn parts are kept with what the virtual array feels of them (`drawn_parts.py`), what was read one
file a part. A part is determined by its number alone, so several runs may share one folder, and a run that was stopped
goes on where it ended. `tests/benchmarks/fit_score.py` fits the score to what was read.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import App

from glyphs.atomic import replacing
from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import random_text
from glyphs.sketch import ROWS_PER_HEIGHT, sketch
from glyphs.soiling.soil import Soil
from glyphs.soiling.soiled import Soiling
from glyphs.surface.maps import HeightMap
from pipeline.formats.synth import SynthSpec, make_part
from recognition.decide.reading import Reading
from recognition.find.first_pass import NothingFeltError, felt_heights_mm, virtual_feel
from recognition.learning.sketches import photograph
from recognition.reader import Reader
from recognition.see.levelling import level, square_to_plate
from recognition.see.view import GREY
from tests.benchmarks.drawn_parts import DrawnPart, KeptSweeps, load_part, save_part, unread_parts

GENERATORS = ("stamped", "sketched", "bevelled", "rusted")
SEVERITIES, SHARES = (0.0, 0.3, 0.6, 0.9), (0.35, 0.3, 0.22, 0.13)
FORMATS = ("AA999999", "AA999999", "AA999999", "AAA9999", "AA99999A", "99999999")
SOILS = ("workshop", "caked", "rust", "paint", "wear", "casting")
DRAWN_SOILS = 8
"""A stamped part whose number among so many has no soil is left out: two soils are kept out of every fit."""
DIES = ("flat", "sharp", "blunt-v", "round", "lopsided", "double", "one-flank")
PLATES = ("machined", "cylinder", "ring", "saddle", "bow", "milled", "turned", "faced", "ground", "sand")
LAYOUTS = ("straight", "turned", "arc")
HEIGHTS_MM = (2.0, 12.0)
FREE = 4
"""Of so many parts one is read without its format."""


def draw_part(number: int, fonts: list[Path], others: Path, *, seed: int = 61) -> DrawnPart:
    """Draw the part of a number.

    Raises:
        MarksError: a font lacks a character.
        ValueError: a font cannot be sketched, or the part is left out.
    """
    rng = np.random.default_rng((seed, number))
    generator = GENERATORS[number % len(GENERATORS)]
    severity = float(rng.choice(SEVERITIES, p=SHARES))
    font, format = fonts[int(rng.integers(len(fonts)))], str(rng.choice(FORMATS))
    height_mm = float(np.exp(rng.uniform(*np.log(HEIGHTS_MM))))
    if generator == "bevelled":
        height_mm = 5.0
    elif generator == "rusted":
        height_mm = 3.0 + 2.0 * (height_mm - HEIGHTS_MM[0]) / (HEIGHTS_MM[1] - HEIGHTS_MM[0])
    wanted = _Wanted(number, generator, severity, font, format, height_mm, others)
    draw = {"stamped": _stamped, "sketched": _sketched}.get(generator, _by_other_generator)
    return draw(wanted, rng)


@dataclass(frozen=True)
class _Wanted:
    number: int
    generator: str
    severity: float
    font: Path
    format: str
    height_mm: float
    others: Path

    def part(
        self, text: str, surface: HeightMap, photo: Photo, *, soil: str = "", layer: Soil | None = None
    ) -> DrawnPart:
        return DrawnPart(
            self.number, self.generator, self.severity, self.font.stem, self.format, soil or self.generator,
            text, self.height_mm, surface, photo, layer,
        )  # fmt: skip


def _stamped(wanted: _Wanted, rng: np.random.Generator) -> DrawnPart:
    soil_number, die = int(rng.integers(DRAWN_SOILS)), str(rng.choice(DIES))
    if soil_number >= len(SOILS):
        raise ValueError("the soil of this part is kept out of every fit")
    soil = SOILS[soil_number]
    plate, layout = str(rng.choice(PLATES)), str(rng.choice(LAYOUTS))
    spec = SynthSpec(
        seed=int(rng.integers(2**31)),
        soiling=Soiling((soil,), wanted.severity),
        format=wanted.format,
        font=str(wanted.font),
        height_mm=round(wanted.height_mm, 2),
        die=die,
        plate=plate,
        layout=layout,
    )
    part = make_part(spec, wanted.number)
    return wanted.part(part.stamped.text, part.height_map, spec.photograph(part), soil=soil, layer=part.soil)


def _sketched(wanted: _Wanted, rng: np.random.Generator) -> DrawnPart:
    text = random_text(wanted.format, rng=rng)
    drawn = sketch(load_font(str(wanted.font)), text, rng)
    grey = np.kron(photograph(drawn, rng)[GREY], np.ones((2, 2)))
    pitch_mm, land = wanted.height_mm / ROWS_PER_HEIGHT, ROWS_PER_HEIGHT // 2
    z_mm = np.pad(drawn.surface, ((land, land), (0, 0)), mode="edge") * np.float32(wanted.height_mm)
    pixels = np.asarray(np.clip(255.0 * grey, 0.0, 255.0), dtype=np.uint8)
    return wanted.part(text, HeightMap(z_mm, pitch_mm), Photo(pixels, pitch_mm=pitch_mm))


def _by_other_generator(wanted: _Wanted, rng: np.random.Generator) -> DrawnPart:
    from fontTools.ttLib import TTFont

    if str(wanted.others) not in sys.path:
        sys.path.insert(0, str(wanted.others))
    rusted = wanted.generator == "rusted"
    module = import_module("make_parts2" if rusted else "make_parts")
    text = "".join(
        str(rng.choice(list(module.LETTERS if place == "A" else module.DIGITS))) for place in wanted.format
    )
    size = (wanted.height_mm, 0.04 * wanted.height_mm) if rusted else ()
    clean = module.plate(text, TTFont(wanted.font), rng, *size)
    z_mm, reflectance = module.soil(clean, rng, wanted.severity)
    pixels = module.photo(z_mm, reflectance, rng, wanted.severity)
    surface = HeightMap(z_mm.astype(np.float32), module.PITCH)
    return wanted.part(text, surface, Photo(pixels, pitch_mm=module.PITCH))


def kept_of(reading: Reading) -> dict[str, Any]:
    """What is kept of a reading: text, flags, measures, and the posteriors of its places."""
    trace = reading.trace
    lattices = (
        dict(trace.by_expert) if trace.lattice is None else {**trace.by_expert, "together": trace.lattice}
    )
    return {
        "text": "".join(reading.text.split()),
        "flags": [flag.name for flag in reading.flags],
        "odds": trace.odds,
        "probability": None if trace.choice is None else trace.choice.probability,
        "measures": {measure.name: value for measure, value in reading.measures.items()},
        "lattices": {
            name: ("".join(lattice.chars), lattice.log_belief.astype(np.float32))
            for name, lattice in lattices.items()
        },
        "faces": dict(trace.faces),
    }


def is_free(number: int) -> bool:
    """Whether a part is read without its format."""
    return (number // len(GENERATORS)) % FREE == 0


def feel_part(part: DrawnPart, reader: Reader, *, least_ratio: float = 0.6) -> KeptSweeps:
    """What the virtual array feels of a part at the heights of characters that a reader scans it for.

    Args:
        part: the part.
        reader: reader that will read it.
        least_ratio: least height, in heights of the most promising one: scans for smaller characters are large, and few
            readings need them.

    Raises:
        MapError: the part cannot be scanned.
    """
    sweeps, array = KeptSweeps(), reader.settings.array
    with sweeps.in_place_of_simulation(), contextlib.suppress(NothingFeltError):
        squared, soil = square_to_plate(part.height_map, part.soil_layer)
        surface = level(squared)
        heights = felt_heights_mm(reader.touch.request, surface, array=array, soil=soil)
        for height_mm in heights:
            if height_mm >= least_ratio * heights[0]:
                virtual_feel(array, soil=soil)(surface, height_mm)
    return sweeps


def read_part(part: DrawnPart, sweeps: KeptSweeps, reader: Reader) -> dict[str, Any]:
    """What is kept of the readings of a part with every sense.

    Raises:
        MarksError: the part cannot be read.
    """
    start = time.process_time()
    with sweeps.in_place_of_simulation():
        touch = reader.read(part.height_map, soil=part.soil_layer)
    felt = time.process_time()
    vision = reader.read(part.photo)
    seconds = (felt - start, time.process_time() - felt)
    readings = {"tactile": touch, "vision": vision, "fused": reader.fuse(touch, vision)}
    kept = {source: kept_of(reading) for source, reading in readings.items()}
    return part.facts | {"format": reader.settings.format or "", "seconds": seconds, "readings": kept}


class _Readers(dict[str, Reader]):
    """Readers by format; each keeps its templates."""

    def __missing__(self, format: str) -> Reader:
        self[format] = Reader(format=format) if format else Reader()
        return self[format]

    def of(self, part: DrawnPart) -> Reader:
        """The reader of a part: one in `FREE` does not know the format."""
        return self["" if is_free(part.number) else part.format]


app = App()


@app.command
def draw(
    fonts: Path,
    others: Path,
    *,
    out: Path,
    parts: int = 100_000,
    first: int = 0,
    step: int = 1,
    hours: float = 2.0,
    seed: int = 61,
) -> None:
    """Draw and feel parts, and keep them.

    Args:
        fonts: folder of font files.
        others: folder of the other generators.
        out: folder of the drawn parts.
        parts: number of parts.
        first: number of the first part.
        step: distance of the numbers.
        hours: time after which the run stops.
        seed: seed of all parts.
    """
    files = sorted(path for path in fonts.iterdir() if path.suffix in (".woff", ".ttf", ".otf"))
    readers, end = _Readers(), time.monotonic() + 3600.0 * hours
    out.mkdir(parents=True, exist_ok=True)
    for number in range(first, parts, step):
        path = out / f"{number:06d}.h5"
        if path.exists():
            continue
        if time.monotonic() > end:
            return
        start = time.process_time()
        try:
            part = draw_part(number, files, others, seed=seed)
        except (MarksError, ValueError, KeyError):
            continue
        drawn = time.process_time()
        try:
            sweeps = feel_part(part, readers.of(part))
        except MarksError as error:
            print(f"part {number}: {error}", flush=True)
            continue
        seconds = {"seconds_drawn": drawn - start, "seconds_felt": time.process_time() - drawn}
        save_part(path, part, sweeps, **seconds)


@app.command
def read(drawn: Path, *, out: Path, first: int = 0, step: int = 1, hours: float = 2.0) -> None:
    """Read parts that were drawn, and keep what was read.

    Args:
        drawn: folder of the drawn parts.
        out: folder of the readings.
        first: number of the first part.
        step: distance of the numbers.
        hours: time after which the run stops.
    """
    readers, simulated = _Readers(), 0
    for source, target in unread_parts(drawn, out, first=first, step=step, hours=hours):
        part, sweeps = load_part(source)
        try:
            kept = read_part(part, sweeps, readers.of(part))
        except MarksError as error:
            print(f"part {part.number}: {error}", flush=True)
            continue
        simulated += sweeps.simulated > 0
        with replacing(target) as temporary:
            temporary.write_bytes(pickle.dumps(kept))
    print(f"{simulated} parts needed scans that were not kept with them")


if __name__ == "__main__":
    os.nice(19)
    app()
