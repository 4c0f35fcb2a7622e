"""Serials that can be read another way: what is accepted of plates that lie as they should, turned, or mirrored.

    python tests/benchmarks/orientation.py plates [--texts 4] [--seed 1] [--fonts gothic,timesr] [--senses touch]
    python tests/benchmarks/orientation.py characters [--texts 150] [--seed 2]

`plates` stamps texts of characters that turn or mirror into one another (with --format any serials), shows each plate
as given, upside down, with its rows in the other order and left to right, and reads it by touch and by photograph.
Nothing wrong may be accepted unless the settings state what is not so. `characters` prints the likely images of
`recognition.language.orientation`.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from cyclopts import App
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.fonts.serials import random_text
from glyphs.part import Part, stamp
from glyphs.surface.maps import HeightMap
from recognition.decide.evidence import Evidence
from recognition.decide.reading import Reading
from recognition.find.finder import Finder
from recognition.language.orientation import Orientation, Way
from recognition.language.remainders import ALPHANUMERIC
from recognition.reader import Reader
from recognition.recogniser.recogniser import posteriors, steps_of
from recognition.see.levelling import level
from recognition.see.view import View, heights_view, photo_view
from recognition.surface import Surface

# characters of a text, its format
ALPHABETS = (
    ("0689", "999999"),
    ("01689HINOSXZMW", "******"),
    ("02358", "999999"),
    ("HINOSXZMW", "AAAAAA"),
    ("AHIMOTUVWXY0123568", "******"),
)
SHOWN: dict[str, Callable[[NDArray], NDArray]] = {
    "as given": lambda grid: grid,
    Way.UPSIDE_DOWN.value: lambda grid: grid[::-1, ::-1],
    Way.ROWS_REVERSED.value: lambda grid: grid[::-1],
    Way.LEFT_RIGHT.value: lambda grid: grid[:, ::-1],
}
HEIGHT_MM = 5.0
app = App()
FONTS = "gothic,timesr,futuram,futural,timesrb"
PLACES = 8
LEAST_BELIEF = 0.03


def texts_of(alphabet: str, count: int, rng: np.random.Generator) -> list[str]:
    return ["".join(rng.choice(list(alphabet), 6)) for _ in range(count)]


def readings(
    part: Part, reader: Reader, senses: set[str], *, rows_known: bool
) -> Iterator[tuple[str, str, Reading]]:
    """Sense, way shown and reading."""
    surface, photo = part.height_map, part.photograph()
    for way, turned in SHOWN.items():
        mirrored = way in (Way.ROWS_REVERSED, Way.LEFT_RIGHT)
        if "touch" in senses and not (mirrored and rows_known):
            shown = HeightMap(np.ascontiguousarray(turned(surface.z_mm)), surface.pitch_mm)
            felt = reader.feel(Surface(shown, rows_known=rows_known))
            yield "touch", way, reader.decide(Evidence.of(felt))
        if "photograph" in senses and not mirrored and rows_known:
            seen = replace(photo, pixels=np.ascontiguousarray(turned(photo.pixels)))
            yield "photograph", way, reader.read(seen)


@app.command
def plates(
    *,
    texts: int = 4,
    format: str = "",
    seed: int = 1,
    fonts: str = FONTS,
    senses: str = "touch,photograph",
    verbose: bool = False,
) -> None:
    """Read plates that lie in every way.

    Args:
        texts: of each alphabet.
        format: serials of this format, in place of those that turn.
        seed: of texts and plates.
        fonts: by name, with commas between.
        senses: likewise.
        verbose: print every reading.
    """
    rng = np.random.default_rng(seed)
    counts: dict[tuple[str, ...], Counter[str]] = defaultdict(Counter)
    lots = [(texts_of(alphabet, texts, rng), mask) for alphabet, mask in ALPHABETS]
    if format:
        lots = [([random_text(format, rng=rng) for _ in range(texts)], format)]
    for serials, mask in lots:
        for number, text in enumerate(serials):
            for font in fonts.split(","):
                part = stamp(text, fonts=font, height_mm=HEIGHT_MM, seed=(seed, number))
                for orientation in Orientation:
                    reader = Reader(format=mask, orientation=orientation, accept_risk=0.01)
                    for rows_known in (True, False):
                        for sense, way, read in readings(
                            part, reader, set(senses.split(",")), rows_known=rows_known
                        ):
                            if orientation is Orientation.UPRIGHT and way in (
                                Way.UPSIDE_DOWN,
                                Way.LEFT_RIGHT,
                            ):
                                continue
                            right = "".join(read.text.split()) == text
                            ended = read.decision.value
                            if ended == "accept":
                                ended = "right" if right else "WRONG"
                            rows = "rows known" if rows_known else "rows unknown"
                            counts[font, sense, f"{orientation.value}, {rows}"][ended] += 1
                            if ended == "WRONG" or verbose:
                                shown = f"{text} {font} {sense}, {way}, {orientation}, {rows}"
                                print(f"{ended}: {shown}: {read} {read.messages()}", flush=True)
    print("| font | sense | settings | parts | accepted, right | accepted, wrong | review | reject |")
    print("|---|---|---|---|---|---|---|---|")
    for (font, sense, settings), ended in sorted(counts.items()):
        cells = (sum(ended.values()), *(ended[name] for name in ("right", "WRONG", "review", "reject")))
        print(f"| {font} | {sense} | {settings} | {' | '.join(map(str, cells))} |")


@app.command
def characters(*, texts: int = 4, seed: int = 1, fonts: str = FONTS) -> None:
    """Print the likely images of characters, from so many texts."""
    rng = np.random.default_rng(seed)
    faces = fonts.split(",")
    belief = {way: defaultdict(Counter) for way in Way}
    seen = {way: Counter() for way in Way}
    for number in range(texts):
        text = "".join(rng.permutation(list(ALPHANUMERIC))[:PLACES])
        part = stamp(text, fonts=faces[number % len(faces)], seed=(seed, number))
        surface, photo = level(part.height_map), part.photograph()
        for way in Way:
            order = text[::-1] if way.reverses else text
            for view, height_mm in views_of(surface, photo, SHOWN[way.value]):
                for line in Finder(view, height_mm).lines()[:1]:
                    steps = steps_of(posteriors(view.strip(line.line)), chars=ALPHANUMERIC)
                    places = steps.places((ALPHANUMERIC,) * PLACES)
                    if places is None:
                        continue
                    for char, row in zip(order, np.exp(places.log_belief), strict=True):
                        seen[way][char] += 1
                        belief[way][char].update(dict(zip(ALPHANUMERIC, map(float, row), strict=True)))
    for way in Way:
        words = (
            char + "".join(c for c in ALPHANUMERIC if belief[way][char][c] / seen[way][char] >= LEAST_BELIEF)
            for char in sorted(seen[way])
        )
        print(f"{way.value}: {' '.join(words)}")


def views_of(
    surface: HeightMap, photo: Photo, turned: Callable[[NDArray], NDArray]
) -> Iterator[tuple[View, float | None]]:
    heights = HeightMap(np.ascontiguousarray(turned(surface.z_mm)), surface.pitch_mm)
    yield heights_view(heights), HEIGHT_MM
    yield photo_view(replace(photo, pixels=np.ascontiguousarray(turned(photo.pixels)))), None


if __name__ == "__main__":
    app()
