"""What a part costs: processor time of one core and looks of the recogniser, beside two yardsticks.

pytest -m benchmark -n 0 -s tests/benchmarks/test_costs.py
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.surface.maps import HeightMap
from recognition.decide.reading import Reading
from recognition.find.looks import Looks
from recognition.find.request import SearchLimits
from recognition.reader import Reader
from recognition.see.text_line import TextLine
from recognition.see.view import photo_view
from tests.benchmarks.one_core import forget_looks, shown
from tests.benchmarks.wide_frames import clutter, framed
from whisker_array.scan.scan import Scan

pytestmark = pytest.mark.benchmark

SERIAL = Path(__file__).parents[1] / "data" / "photos" / "1X2100H.jpg"
SHAPE = (3000, 4000)


def looks_of(reading: Reading) -> int:
    return sum(sense.lines.looks for sense in reading.evidence.senses if sense.lines is not None)


def cpu_s(task: Callable[[], object]) -> float:
    start = time.process_time()
    task()
    return time.process_time() - start


def row(what: str, reader: Reader, parts: Sequence[Scan | Photo | HeightMap]) -> str:
    """Median and 95th percentile of the time of some parts, and their most looks."""
    readings: list[Reading] = []
    seconds: list[float] = []
    reader.read(parts[0])
    for part in parts:
        forget_looks()
        seconds.append(cpu_s(lambda part=part: readings.append(reader.read(part))))
    median, most = np.percentile(seconds, (50, 95))
    looks = [looks_of(reading) for reading in readings]
    return f"| {what} | {1e3 * median:.0f} | {1e3 * most:.0f} | {np.median(looks):.0f} | {max(looks)} |"


def yardsticks(photo: Photo) -> list[str]:
    """A look at a line of eight characters, and RapidOCR's detector with its recogniser on the photograph."""
    view = photo_view(photo)
    width, height = view.size_mm
    # each look at another place: the network's latest outputs are kept
    lines = [
        TextLine.straight(
            0.05 * width + k * view.pitch_mm, 0.5 * height, length_mm=0.8 * width, height_mm=0.4 * height
        )
        for k in range(9)
    ]
    seconds = [cpu_s(lambda line=line: Looks().posteriors(view, line)) for line in lines]
    rows = [f"| one look of the recogniser | {1e3 * min(seconds):.0f} | | 1 | 1 |"]
    rapid = pytest.importorskip("rapidocr").RapidOCR()
    pixels = np.ascontiguousarray(np.atleast_3d(photo.eight_bit)[..., :3])
    rapid(pixels)
    seconds = [cpu_s(lambda: rapid(pixels)) for _ in range(3)]
    return [
        *rows,
        f"| RapidOCR, detector and recogniser, clean photograph | {1e3 * min(seconds):.0f} | | | |",
    ]


def test_costs_of_parts() -> None:
    cv2.setNumThreads(1)
    reader = Reader(format="AA999999")
    ground = clutter(SHAPE, np.random.default_rng(4))
    plate = cv2.imread(str(SERIAL), cv2.IMREAD_GRAYSCALE)
    whole = (0.0, 0.0, float(plate.shape[1]), float(plate.shape[0]))
    frame, (x0, y0, x1, y1) = framed(plate, whole, 0.19, ground, np.random.default_rng(1))
    region = (x0 / SHAPE[1], y0 / SHAPE[0], x1 / SHAPE[1], y1 / SHAPE[0])
    engraved = Reader(format="9A9999A")
    sure_photo, sure_scan = shown("photo", "sure"), shown("scan", "sure")
    assert reader.read(sure_photo[0]).decision == "accept"
    rows = [
        *yardsticks(sure_photo[0]),
        row("photograph, clean", reader, sure_photo),
        row("photograph, eight soils at 0.9", reader, shown("photo", "unsure")),
        row("photograph without a serial, 0.5 million pixels", reader, [Photo(ground[:600, :900].copy())]),
        row("black photograph, 0.5 million pixels", reader, [Photo(np.zeros((600, 800), dtype=np.uint8))]),
        row("recorded scan, clean", reader, sure_scan),
        row("recorded scan, eight soils at 0.9", reader, shown("scan", "unsure")),
        row("flat height map", reader, [HeightMap(np.zeros((260, 800)), 0.05)]),
        row("12 million pixels, blank", reader, [Photo(np.full(SHAPE, 120, dtype=np.uint8))]),
        row("12 million pixels, clutter alone", reader, [Photo(ground)]),
        row("12 million pixels, serial of 19 % of the width", engraved, [Photo(frame)]),
        row("the same with its region", Reader(replace(engraved.settings, region=region)), [Photo(frame)]),
    ]
    print(
        "\n| part | CPU, ms: median | 95 % | looks: median | most |\n|---|---|---|---|---|", *rows, sep="\n"
    )
    limits = SearchLimits()
    most_looks = limits.most_looks + limits.layout_looks
    assert all(int(line.split("|")[-2]) <= 2 * most_looks for line in rows if "recogniser" not in line)
