"""Accuracy of reading by a coarser plan: measured on simulated parts, for `design --array`::

    python tests/benchmarks/plan_accuracy.py --parts 60 --seed 1700 --write

Every part, drawn as those of the exam but of no font or dirt that it keeps out, is felt by each plan about its line
alone, as where a camera or a job says where it lies, and read with the format of its serials; fonts are not named. A
plan is lines a character height, and directions; each has sensor noise of its own. What is kept is counts, by plan and
dirt (whisker_array/design/plan_accuracy.fit.json).
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from datetime import date
from functools import cache

import numpy as np
from rapidfuzz.distance import Levenshtein

from glyphs.errors import MarksError
from glyphs.surface.maps import TraceDirection
from pipeline.benchmark.exam.design import Design, design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from recognition import Orientation, Reader
from recognition.decide.decision import Decision
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from whisker_array.design.plan_accuracy import MEASURED, PlanCounts, describe_directions
from whisker_array.scan.scan import Scan
from whisker_array.whisker.array import default_plan

LINES = (10, 14, 20, 40)
WAYS = ((0,), (0, 180), (90,), (90, 270), (0, 90, 180, 270))
"""Trace directions, degrees: along the line one way and both, across it likewise, and all four."""
SEVERITIES = (0.3, 0.6)
EDITION = "marks-exam-1-208"
"""Whose kinds of parts are drawn, with another seed."""
BESIDE_HEIGHTS = 0.5
"""Land that is felt around the line, character heights."""
_log = logging.getLogger(__name__)


def trial_parts(parts: int, seed: int, *, severities: tuple[float, ...] = SEVERITIES) -> Design:
    """Parts as those of the exam, but of no font or dirt that it keeps out, in turn of each severity."""
    exam = design_named(EDITION)
    soils = tuple(s for s in exam.part["soil"] if s not in exam.kept_out_soils)
    first, *others = (s for s in exam.sections if not s.kept_out)
    few = [max(1, round(parts * s.parts / sum(o.parts for o in (first, *others)))) for s in others]
    sizes = (parts - sum(few), *few)
    sections = tuple(s.model_copy(update={"parts": n}) for s, n in zip((first, *others), sizes, strict=True))
    part = {**exam.part, "severity": severities, "soil": soils}
    changed = {"name": "plan-accuracy", "seed": seed, "sections": sections, "part": part}
    return exam.model_copy(update=changed)


@cache
def reader_of(mask: str) -> Reader:
    """A reader of serials of this format on parts that lie upright."""
    return Reader(format=mask, orientation=Orientation.UPRIGHT)


def read_right(scan: Scan, truth: str, mask: str) -> tuple[int, bool]:
    """Characters that touch reads right, blanks aside, and whether it accepts the serial."""
    try:
        reading = reader_of(mask).read(scan)
    except MarksError as error:
        _log.info("%s: %s", truth, error)
        return 0, False
    off = int(Levenshtein.distance("".join(reading.text.split()), truth))
    return max(0, len(truth) - off), reading.decision is Decision.ACCEPT


def counted(parts: int, seed: int) -> Iterator[PlanCounts]:
    """Results of one plan, part after part."""
    made = DesignedParts(trial_parts(parts, seed))
    for number, item in enumerate(made.items()):
        part = made.make(item)
        if part.line_mm is None or part.height_mm is None:
            continue
        beside = BESIDE_HEIGHTS * part.height_mm
        width, height = part.height_map.size_mm
        x0, y0, x1, y1 = part.line_mm
        region = (
            max(0.0, x0 - beside),
            max(0.0, y0 - beside),
            min(width, x1 + beside),
            min(height, y1 + beside),
        )
        for lines in LINES:
            for ways in WAYS:
                plan = default_plan(
                    region,
                    character_height_mm=part.height_mm,
                    lines_per_height=lines,
                    directions=tuple(TraceDirection(d) for d in ways),
                )
                noise = int(np.random.SeedSequence((seed, number, lines, *ways)).generate_state(1)[0])
                bench = VirtualBench(
                    part.height_map, part.height_mm, VirtualArray(seed=noise), soil=part.soil
                ).mounted()
                right, accepted = read_right(bench.scan(plan), part.truth, item.condition.format)
                yield PlanCounts(
                    lines=lines,
                    directions=ways,
                    severity=float(item.condition.severity or 0.0),
                    parts=1,
                    characters=len(part.truth),
                    right=right,
                    accepted=int(accepted),
                    accepted_wrong=int(accepted and right < len(part.truth)),
                )


def accuracy_words(counts: Sequence[PlanCounts]) -> list[str]:
    """A table for people."""
    rows = ["lines  directions            dirt  parts  characters  accepted  of these wrong"]
    rows += [
        f"{c.lines:5d}  {describe_directions(c.directions):20s}  {c.severity:4.1f}  {c.parts:5d}"
        f"  {100 * c.accuracy:9.1f}%"
        f"  {c.accepted:8d}  {c.accepted_wrong:14d}"
        for c in counts
    ]
    return rows


def main(*, parts: int = 60, seed: int = 1700, write: bool = False) -> None:
    """Measure, say what was found, and with --write keep it.

    Args:
        parts: how many.
        seed: of the parts.
        write: replace the counts of the program as parts are read.
    """
    command = f"python tests/benchmarks/plan_accuracy.py --parts {parts} --seed {seed} --write"
    sums: dict[tuple[int, tuple[int, ...], float], PlanCounts] = {}
    plans, drawn = len(LINES) * len(WAYS), trial_parts(parts, seed)
    for k, one in enumerate(counted(parts, seed), start=1):
        key = (one.lines, one.directions, one.severity)
        if key in sums:
            numbers = ("parts", "characters", "right", "accepted", "accepted_wrong")
            one = replace(one, **{name: getattr(one, name) + getattr(sums[key], name) for name in numbers})
        sums[key] = one
        if write and k % plans == 0:
            manifest = {
                "what": "characters and serials read, by plan and dirt (whisker_array/design/plan_accuracy.py)",
                "command": command,
                "made": date.today().isoformat(),
                "parts": k // plans,
                "asked": parts,
                "editions": {EDITION: k // plans},
                "fonts": sorted({str(f) for s in drawn.sections for f in s.part["font"]}),
                "soils": list(drawn.part["soil"]),
                "counts": [asdict(sums[key]) for key in sorted(sums)],
            }
            MEASURED.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    print("\n".join(accuracy_words(tuple(sums[key] for key in sorted(sums)))))


if __name__ == "__main__":
    from cyclopts import run

    run(main)
