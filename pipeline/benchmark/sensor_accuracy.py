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
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.benchmark.plan_accuracy import trial_parts

SEVERITIES = (0.0, 0.3, 0.6)
BENCHES = {"ideal": (False, False), "steady": (True, False), "real": (True, True)}
"""Noise and memory of each."""


@dataclass(frozen=True)
class SensorTrial:
    """One part read with one bench.

    Attributes:
        part: its name.
        severity: of its dirt.
        bench: of `BENCHES`.
        characters: of its serial.
        right: of them.
        accepted: by the decision.
    """

    part: str
    severity: float
    bench: str
    characters: int
    right: int
    accepted: bool

    @property
    def wrong_accepted(self) -> bool:
        """Whether a serial that is not the part's was accepted."""
        return self.accepted and self.right < self.characters


def tried(parts: int, seed: int, severity: float) -> Iterator[SensorTrial]:
    """Part after part, each with every bench in turn."""
    from rapidfuzz.distance import Levenshtein

    from glyphs.errors import MarksError
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.reading.simulated_scan import feel
    from recognition import Reader
    from recognition.decision.reading import Decision
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
                text, accepted = "".join(reading.text.split()), reading.decision is Decision.ACCEPT
            except MarksError:
                text, accepted = "", False
            right = max(0, len(part.truth) - int(Levenshtein.distance(text, part.truth)))
            yield SensorTrial(part.part, severity, bench, len(part.truth), right, accepted)


def table(trials: Sequence[SensorTrial]) -> list[str]:
    """A line for each dirt and bench: characters right, what was lost against `steady`, serials.

    Intervals hold 95 %: of a share, exact (Clopper and Pearson); of what was lost, by the parts' differences (Student).
    """
    from scipy.stats import binomtest

    lines = [
        "dirt  bench   parts  characters, %             lost to steady, points   parts that differ"
        "  accepted  wrong"
    ]
    for severity in sorted({t.severity for t in trials}):
        of = {b: [t for t in trials if t.severity == severity and t.bench == b] for b in BENCHES}
        for bench, own in of.items():
            right, all_ = sum(t.right for t in own), sum(t.characters for t in own)
            share = binomtest(right, all_).proportion_ci(0.95, "exact")
            pairs = list(zip(of["steady"], own, strict=True))
            lost, half = _lost([100.0 * (a.right - b.right) / a.characters for a, b in pairs])
            lines.append(
                f"{severity:<5g} {bench:<7} {len(own):>5}  {100.0 * right / all_:5.1f} "
                f"({100.0 * share.low:5.1f} to {100.0 * share.high:5.1f})  "
                f"{lost:6.2f} ({lost - half:5.2f} to {lost + half:5.2f})   "
                f"{sum(a.right != b.right for a, b in pairs):>8}            "
                f"{sum(t.accepted for t in own):>6}  {sum(t.wrong_accepted for t in own):>5}"
            )
    return lines


def _lost(points: Sequence[float]) -> tuple[float, float]:
    """Mean of the parts' differences, and half its 95 % interval."""
    import numpy as np
    from scipy.stats import t

    values = np.asarray(points)
    if values.size < 2:
        return float(values.mean()), math.inf
    return float(values.mean()), float(
        t.ppf(0.975, values.size - 1) * values.std(ddof=1) / np.sqrt(values.size)
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and say what was found dirt by dirt."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--parts", type=int, default=60, help="of each dirt")
    asked.add_argument("--seed", type=int, default=1700)
    asked.add_argument("--dirt", type=float, nargs="+", default=SEVERITIES, help="0 to 1")
    given = asked.parse_args(arguments)
    trials: list[SensorTrial] = []
    for severity in given.dirt:
        trials += tried(given.parts, given.seed, severity)
    print("\n".join(table(trials)))


if __name__ == "__main__":
    main()
