"""What creep, hysteresis, play and errors of the stage cost in characters: measured on simulated parts::

    python -m pipeline.benchmark.sensor_accuracy --parts 60 --seed 1700

Every part, drawn as those of the exam but of no font or dirt that it keeps out, is felt by the usual plan with three
benches and read by touch, with the format of its serials; fonts are not named::

    ideal     no gains, no noise
    steady    gains, offsets, noise, vibration, drift, 16 bits; nothing of earlier loads, a stage without play
    real      the same sensors and noise, and they creep and lag, and the stage has play: the default
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from pipeline.benchmark.paired import Trial, table, trial_of
from pipeline.benchmark.plan_accuracy import trial_parts

SEVERITIES = (0.0, 0.3, 0.6)
BENCHES = {"ideal": (False, False), "steady": (True, False), "real": (True, True)}
"""Noise and memory of each."""


def tried(parts: int, seed: int, severity: float) -> Iterator[Trial]:
    """Part after part, each with every bench in turn."""
    from glyphs.errors import MarksError
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.reading.simulated_scan import feel
    from recognition import Reader
    from whisker_array.whisker.array import default_plan

    made = DesignedParts(trial_parts(parts, seed, severities=(severity,)))
    readers: dict[str, Reader] = {}
    for number, item in enumerate(made.items()):
        part = made.make(item)
        if part.height_mm is None:
            continue
        reader = readers.setdefault(item.condition.format, Reader(format=item.condition.format))
        plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=part.height_mm)
        for bench, (noise, memory) in BENCHES.items():
            scan = feel(
                part.height_map,
                plan=plan,
                height_mm=part.height_mm,
                noise=noise,
                memory=memory,
                sensor_seed=seed + number,
                soil=part.soil,
            )
            try:
                reading = reader.touch.read_scan(scan)
            except MarksError:
                reading = None
            yield trial_of(reading, part=part.part, severity=severity, way=bench, truth=part.truth)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and say what was found dirt by dirt."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--parts", type=int, default=60, help="of each dirt")
    asked.add_argument("--seed", type=int, default=1700)
    asked.add_argument("--dirt", type=float, nargs="+", default=SEVERITIES, help="0 to 1")
    given = asked.parse_args(arguments)
    trials: list[Trial] = []
    for severity in given.dirt:
        trials += tried(given.parts, given.seed, severity)
    print("\n".join(table(trials, against="steady")))


if __name__ == "__main__":
    main()
