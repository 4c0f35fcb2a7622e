"""Characters lost to creep, hysteresis, play and errors of the stage: measured on simulated parts::

    python -m tests.benchmarks.sensor_accuracy --parts 60 --seed 1700

Every part, drawn as those of the exam but of no font or dirt that it keeps out, is felt by the usual plan with three
benches and read by touch, with the format of its serials; fonts are not named::

    ideal     no gains, no noise
    steady    gains, offsets, noise, vibration, drift, 16 bits; nothing of earlier loads, a stage without play
    real      the same sensors and noise, and they creep and lag, and the stage has play: the default
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from tests.benchmarks.paired import Trial, table, tried

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Specimen
    from whisker_array.scan.scan import Scan

SEVERITIES = (0.0, 0.3, 0.6)
BENCHES = {"ideal": (False, False), "steady": (True, False), "real": (True, True)}
"""Noise and memory of each."""


def felt_by_benches(part: Specimen, seed: int) -> Iterator[tuple[str, Scan]]:
    """The part as every bench feels it."""
    from pipeline.reading.simulated_scan import feel
    from whisker_array.whisker.array import default_plan

    height_mm = part.height_mm or 5.0
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=height_mm)
    for bench, (noise, memory) in BENCHES.items():
        yield bench, feel(
            part.height_map, plan=plan, height_mm=height_mm, noise=noise, memory=memory, sensor_seed=seed,
            soil=part.soil,
        )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and say what was found dirt by dirt."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--parts", type=int, default=60, help="of each dirt")
    asked.add_argument("--seed", type=int, default=1700)
    asked.add_argument("--dirt", type=float, nargs="+", default=SEVERITIES, help="0 to 1")
    given = asked.parse_args(arguments)
    trials: list[Trial] = []
    for severity in given.dirt:
        trials += tried(given.parts, given.seed, severity, felt_by_benches)
    print("\n".join(table(trials, against="steady")))


if __name__ == "__main__":
    main()
