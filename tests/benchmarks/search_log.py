"""Log which try of a search gains how many characters at which cost, over unlike parts, and print the table of tries::

    python tests/benchmarks/search_log.py FONTS OTHER_GENERATORS --out searches.csv --parts 200

FONTS and OTHER_GENERATORS are as in `risk_parts.py`, whose parts are drawn with another seed. Every search goes on
without a price, so each try is seen from all states of the best line. Gains and costs of the table are those of
`recognition.find.tries`.
"""

from __future__ import annotations

import csv
import os
import time
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from recognition.find.find import search_of
from recognition.find.first_pass import virtual_feel
from recognition.find.promise import is_convincing, share_of
from recognition.find.request import LineRequest, SearchLimits
from recognition.find.tries import BANDS
from recognition.language.constrained_decoding import choose
from recognition.recogniser.read_line import ReadLine
from recognition.see.levelling import level, square_to_plate
from recognition.see.photo_sizes import shrunk_versions
from recognition.see.registered import photo_views
from recognition.see.view import View
from recognition.settings import ReaderSettings, Repertoire
from recognition.touch import see_scan
from tests.benchmarks.risk_parts import FREE, GENERATORS, DrawnPart, draw_part
from whisker_array.estimation.edges import edge_map

COLUMNS = ("part", "generator", "severity", "sense", "try", "band", "looks", "ms", "before", "after")
NO_PRICE = SearchLimits(most_looks=60, spared_looks=0, least_gain_per_ms=-1.0)


def right_characters(lines: Sequence[ReadLine], request: LineRequest, truth: str) -> int:
    """Number of right characters of the first line; 0 if their number is wrong."""
    text = choose(lines[0].lattice, request.grammar, k=1).text if lines else ""
    return sum(a == b for a, b in zip(text, truth, strict=True)) if len(text) == len(truth) else 0


def views_of(part: DrawnPart) -> Iterator[tuple[str, View]]:
    """The part as it is felt and as it is photographed."""
    squared, soil = square_to_plate(part.height_map, part.soil_layer)
    scan = virtual_feel(soil=soil)(level(squared), part.height_mm)
    yield "felt", see_scan(scan, edge_map(scan))[0]
    yield "seen", photo_views(next(shrunk_versions(part.photo)))[0][0]


def searched(part: DrawnPart, sense: str, view: View, request: LineRequest) -> Iterator[tuple[Any, ...]]:
    """Each try of a search without a price; nothing if the first look settles the line."""
    search = search_of(view, LineRequest(request.grammar, request.chars, limits=NO_PRICE))
    lines = search.read(search.candidates()[:1])
    if is_convincing(lines, NO_PRICE.settled):
        return
    lines = search.read([read.line for read in lines], cheap=True)
    before, looks, start_s = lines, search.looks.count, time.process_time()
    for row, after in search.walk(lines):
        ms = 1e3 * (time.process_time() - start_s)
        band = bisect_right(BANDS, share_of(before[0]) if before else -1.0)
        right = [right_characters(lines, request, part.text) for lines in (before, after)]
        yield (
            part.number, part.generator, part.severity, sense, row.name, band, search.looks.count - looks,
            round(ms, 1), *right,
        )  # fmt: skip
        before, looks, start_s = after, search.looks.count, time.process_time()


def table_of(log: Path) -> Iterator[str]:
    """Median cost of each try, and mean gain of its first looks by the band of the best line (with their number)."""
    costs_ms, gains = (
        defaultdict[tuple[str, str], list[float]](list),
        defaultdict[tuple[str, str, int], list[int]](list),
    )
    seen = set[tuple[str, ...]]()
    with log.open() as file:
        for row in csv.DictReader(file):
            name, sense = row["try"], row["sense"]
            if (first := (row["part"], name, sense)) not in seen:
                seen.add(first)
                costs_ms[name, sense].append(float(row["ms"]))
                gains[name, sense, int(row["band"])].append(int(row["after"]) - int(row["before"]))
    for (name, sense), ms in sorted(costs_ms.items()):
        bands = [gains[name, sense, band] for band in range(len(BANDS) + 1)]
        means = (f"{np.mean(each):5.2f} ({len(each)})" if each else "    - (0)" for each in bands)
        yield f"{name:12} {sense}  {np.median(ms):5.0f} ms  {'  '.join(means)}"


def main(fonts: Path, others: Path, *, out: Path, parts: int = 200, seed: int = 62) -> None:
    """Draw, search without a price, and print the table.

    Args:
        fonts: folder of font files.
        others: folder of the other generators.
        out: file of the log, one line a try.
        parts: number of parts.
        seed: seed of the parts.
    """
    os.nice(19)
    files = sorted(path for path in fonts.iterdir() if path.suffix in (".woff", ".ttf", ".otf"))
    with out.open("w") as file:
        log = csv.writer(file)
        log.writerow(COLUMNS)
        for number in range(parts):
            try:
                part = draw_part(number, files, others, seed=seed)
                views = list(views_of(part))
            except (MarksError, ValueError, KeyError):
                continue
            format = None if (number // len(GENERATORS)) % FREE == 0 else part.format
            request = Repertoire(ReaderSettings(format=format)).request
            for sense, view in views:
                log.writerows(searched(part, sense, view, request))
            file.flush()
    print(*table_of(out), sep="\n")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
