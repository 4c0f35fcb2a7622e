"""A process that does one thing again for every line it is sent, on one core, and answers when it is done.

    python one_core.py edge_map | scan_sure | scan_unsure | photo_sure | photo_unsure | read_height_map |
        read_coins | exam_SOIL

Thread counts must be set in the environment before numpy is loaded, so this is a process of its own.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import count, cycle, pairwise
from pathlib import Path

from glyphs.camera.photo import Photo
from glyphs.part import stamp
from glyphs.soiling.soil import Soil
from glyphs.soiling.soils import SOILS
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.formats.touch_file import read_height_map
from recognition.reader import Reader
from recognition.recogniser.recogniser import _outputs
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from recognition.settings import ReaderSettings
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import Sensors

TEXT = "KR804217"
HEIGHT_MM = 5.0


def a_part(text: str, seed: int) -> HeightMap:
    """A stamped part with all its variation."""
    return stamp(text, fonts="gothic", height_mm=HEIGHT_MM, seed=seed).height_map


def task(name: str) -> Callable[[], str]:
    """The task by its name; everything before it is warm."""
    if name == "read_height_map":
        reader = Reader(ReaderSettings(fonts=("gothic",), format="AA999999", height_mm=HEIGHT_MM))
        reader.read(a_part("BZ135690", 2))
        surface = a_part(TEXT, 1)
        return partial(read_again, reader, surface)
    if name.startswith("exam_"):
        return partial(exam_part, name.removeprefix("exam_"), count(1))
    if name == "read_coins":
        coins = sorted((Path(__file__).parents[1] / "data").glob("penny_*.npz"))
        return partial(read_next, Reader(), cycle([read_height_map(path) for path in coins]))
    if name == "edge_map":
        scan = felt(a_part(TEXT, 1), sensors=Sensors.REAL)
        return lambda: "x".join(str(n) for n in edge_map(scan).shape)
    return partial(read_next, Reader(ReaderSettings(format="AA999999")), cycle(shown(*name.split("_"))))


def shown(sense: str, how: str) -> list[Scan | Photo | HeightMap]:
    """A clean part, of which a reader is sure, or one of every soil, so dirty that it mostly is not."""
    parts = exam_parts(soil=list(SOILS), severity=0.9 if how == "unsure" else 0.0)
    made = [parts.make(item) for item in parts.items()[: None if how == "unsure" else 1]]
    if sense == "scan":
        return [felt(specimen.height_map, soil=specimen.soil) for specimen in made]
    return [specimen.take_photo() for specimen in made if specimen.take_photo is not None]


def forget_looks() -> None:
    """Forget the network's latest outputs: a part that is read again must not find the looks of before."""
    _outputs.cache_clear()


def read_again(reader: Reader, surface: HeightMap) -> str:
    """The text and the seconds of every step."""
    forget_looks()
    reading = reader.read(surface)
    steps = " ".join(f"{step}={seconds:.4f}" for step, seconds in reading.seconds.items())
    return f"{reading.text} {steps}"


def read_next(reader: Reader, views: Iterator[Scan | Photo | HeightMap]) -> str:
    """Processor seconds of a reading, what was decided, and what was read."""
    forget_looks()
    before = time.process_time()
    reading = reader.read(next(views))
    return f"{time.process_time() - before:.4f} {reading.decision.value} {reading.text}"


def exam_parts(**levels: object) -> DesignedParts:
    """Parts of an exam that differ in these levels alone."""
    own = {"font": "gothic", "format": "AA999999", "height_mm": HEIGHT_MM, **levels}
    return DesignedParts(Design.of(parts=len(SOILS), cross=("soil",), part=own))


def felt(surface: HeightMap, *, sensors: Sensors = Sensors.IDEAL, soil: Soil | None = None) -> Scan:
    """In four directions."""
    return VirtualBench(surface, HEIGHT_MM, VirtualArray(sensors=sensors), soil=soil).mounted().scan()


def exam_part(soil: str, numbers: Iterator[int]) -> str:
    """A part of an exam: stamped, soiled, photographed and felt. What it took: processor seconds of each step."""
    parts = exam_parts(soil=soil, severity=0.6)
    item = replace(parts.items()[0], number=next(numbers))
    spent = [time.process_time()]
    specimen = parts.make(item)
    spent.append(time.process_time())
    assert specimen.take_photo is not None
    specimen.take_photo()
    spent.append(time.process_time())
    felt(specimen.height_map, soil=specimen.soil)
    spent.append(time.process_time())
    steps = zip(("make", "photo", "scan"), pairwise(spent), strict=True)
    return " ".join(f"{step}={b - a:.4f}" for step, (a, b) in steps)


if __name__ == "__main__":
    do = task(sys.argv[1])
    do()
    print("ready", flush=True)
    for _ in sys.stdin:
        print(do(), flush=True)
