"""Share of faults of whiskers and bench that are named, false alarms, and what is read with a dead whisker.

    python -m tests.benchmarks.bench_faults --parts 120 --faulty 40 --read 20 --start 20

Parts are those of a named exam edition, all its soils and severities, in contact; faults as
`tests.support.bench_faults` makes them, on whiskers 1 and 3 by turns. What was named goes to standard output.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from pipeline.benchmark.exam.design import design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.common.shares import share
from recognition.reader import Reader
from recognition.see.levelling import level
from tests.support.bench_faults import recorded, with_whisker_of, worn
from tests.support.felt import felt
from whisker_array.estimation.faults import FaultKind, find_faults
from whisker_array.whisker.touch import default_touch

WORN_RADII = 6.0
"""Radius of a worn tip over a new one's, which is 0.06 mm at characters of 5 mm."""


def main(
    *,
    parts: int = 60,
    faulty: int = 20,
    read: int = 10,
    start: int = 20,
    sizes: tuple[float, ...] = (1.0, 0.5),
) -> None:
    exam = DesignedParts(design_named("marks-exam-1-1600"))
    items = [one for one in exam.items() if int(one.part[-4:]) >= start]
    items = items[:: max(1, len(items) // parts)][:parts]
    alarms: Counter[str] = Counter()
    named: Counter[tuple[float, FaultKind]] = Counter()
    besides: dict[tuple[float, FaultKind], Counter[str]] = {}
    right: Counter[str] = Counter()
    chosen = set(range(0, len(items), max(1, len(items) // faulty)))
    n_read = 0
    for i, item in enumerate(items):
        part = exam.make(item)
        touch = default_touch(part.height_mm or 5.0)
        surface = level(part.height_map)
        sound = felt(surface, part.height_mm or 5.0, touch=touch, soil=part.soil)
        found = find_faults(recorded(sound, rng=np.random.default_rng(i)))
        alarms.update({"any": bool(found), **dict.fromkeys({f.kind.value for f in found}, 1)})
        if i not in chosen:
            continue
        whisker = 1 + 2 * (i % 2)
        for size in sizes:
            for kind in FaultKind:
                ideal, fault = sound, kind
                if kind is FaultKind.WORN:
                    radius = touch.tip_radius_mm * (1.0 + (WORN_RADII - 1.0) * size)
                    old = worn(touch, radius_mm=radius, shorter_mm=0.02 * touch.preload_mm)
                    by_old = felt(surface, part.height_mm or 5.0, touch=old, soil=part.soil)
                    ideal = with_whisker_of(sound, by_old, whisker)
                scan = recorded(ideal, rng=np.random.default_rng(i), fault=fault, whisker=whisker, size=size)
                found = find_faults(scan)
                hit = [f for f in found if f.kind is kind and f.whisker in (None, whisker)]
                named[size, kind] += bool(hit)
                besides.setdefault((size, kind), Counter()).update(
                    {f.kind.value for f in found if f not in hit}
                )
        if n_read < read and item.condition.severity <= 0.3:
            n_read += 1
            reader = Reader(format=item.condition.format)
            dead = recorded(sound, rng=np.random.default_rng(i), fault=FaultKind.DEAD, whisker=whisker)
            whole = recorded(sound, rng=np.random.default_rng(i))
            right["sound"] += reader.read(whole).text == part.truth
            right["dead, left out"] += reader.read(dead).text == part.truth
            right["dead, as felt"] += reader.touch.reading_of(reader.touch.of_scan(dead)).text == part.truth
    print(f"sound recordings with an alarm: {_said(alarms['any'], len(items))} {dict(alarms)}")
    for (size, kind), n in named.items():
        print(
            f"{kind.value:14s} x {size:g}: named {_said(n, len(chosen))}; besides {dict(besides[size, kind])}"
        )
    print(f"serials right of {n_read} at dirt 0 and 0.3: {dict(right)}")


def _said(count: int, total: int) -> str:
    found = share(count, total)
    return f"{count} of {total} ({100.0 * found.low:.0f} to {100.0 * found.high:.0f} %)"


if __name__ == "__main__":
    from cyclopts import run

    run(main)
