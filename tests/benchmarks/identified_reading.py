"""Characters read with the whisker that `identify` has found, and with the true one.

    python -m tests.benchmarks.identify_benches --benches 200 --out benches.jsonl
    python -m tests.benchmarks.identified_reading --benches benches.jsonl --dirt 0.3

Each bench of the first, its hidden numbers true, feels a part of its own by the usual plan; the scan is read as of the
bench that is true, and as of the one that was found there. Parts are drawn as those of the exam but of no font or dirt
that it keeps out. Numbers are those of a whisker for characters of 5 mm, and go with the height of the part's.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.benchmark.exam.specimens import Specimen
from tests.benchmarks.known_whisker import felt
from tests.benchmarks.paired import table, tried
from tests.support.benches import HEIGHT_MM
from whisker_array.identification.bench import Bench, nominal_bench
from whisker_array.scan.scan import Scan
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import Touch, default_touch

TRUE, FOUND = "true", "as identified"


def of_height(bench: Bench, height_mm: float) -> Touch:
    """A bench for 5 mm scaled to characters of another height: lengths, radius and preload go with it."""
    drawn, like = (default_whisker(height) for height in (height_mm, HEIGHT_MM))
    here, there = (
        nominal_bench(whisker, default_touch(height), n_whiskers=1).values
        for whisker, height in ((drawn, height_mm), (like, HEIGHT_MM))
    )
    values = {
        name: value * here[name] / there[name] if there[name] else value
        for name, value in bench.values.items()
    }
    return replace(bench, values=values).touch(drawn)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--benches", type=Path, required=True)
    parser.add_argument("--most", type=int, default=200, help="benches")
    parser.add_argument("--first", type=int, default=0, help="of the file, leave out so many")
    parser.add_argument("--dirt", type=float, default=0.3, help="0 to 1")
    parser.add_argument("--seed", type=int, default=2600)
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = [json.loads(line) for line in asked.benches.read_text().splitlines()]
    rows = sorted((row for row in rows if "refused" not in row), key=lambda row: int(row["seed"]))
    rows = rows[asked.first : asked.first + asked.most]

    def ways(part: Specimen, seed: int) -> Iterator[tuple[str, Scan]]:
        true, found = (
            Bench.of_vector(np.array(numbers)) for numbers in rows[(seed - asked.seed) % len(rows)]["numbers"]
        )
        height_mm = part.height_mm or HEIGHT_MM
        scan = felt(part, of_height(true, height_mm), rng=np.random.default_rng(seed))
        yield TRUE, scan
        assert scan.calibration is not None
        # the fitted comb has fewer whiskers than the one that reads
        off = np.resize(found.gain / true.gain, scan.n_whiskers)
        known = replace(scan.calibration, gain=scan.calibration.gain * off)
        yield FOUND, replace(scan, touch=of_height(found, height_mm), calibration=known)

    trials = list(tried(len(rows), asked.seed, asked.dirt, ways))
    print("\n".join(table(trials, against=TRUE)))


if __name__ == "__main__":
    main()
