"""The same parts read in several ways, and the characters that each way loses to the first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from recognition.decision.decide import Decision
from recognition.decision.reading import Reading
from tests.benchmarks.plan_accuracy import trial_parts

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Specimen
    from whisker_array.scan.scan import Scan

    Ways = Callable[[Specimen, int], Iterator[tuple[str, Scan]]]


@dataclass(frozen=True)
class Trial:
    """One part read in one way.

    Attributes:
        part: its name.
        severity: of its dirt.
        way: what the way is called.
        characters: of its serial.
        right: of them.
        accepted: by the decision.
    """

    part: str
    severity: float
    way: str
    characters: int
    right: int
    accepted: bool

    @property
    def wrong_accepted(self) -> bool:
        """Whether a serial that is not the part's was accepted."""
        return self.accepted and self.right < self.characters


def tried(parts: int, seed: int, severity: float, ways: Ways) -> Iterator[Trial]:
    """Part after part, drawn as those of the exam but of no font or dirt that it keeps out, read in every way.

    Args:
        parts: how many.
        seed: of the parts; a part's own is that plus its number.
        severity: of their dirt.
        ways: of a part and its seed, what each way is called and the scan that is read, with the serial's format.
    """
    from glyphs.errors import MarksError
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from recognition import Orientation, Reader

    made = DesignedParts(trial_parts(parts, seed, severities=(severity,)))
    readers: dict[str, Reader] = {}
    for number, item in enumerate(made.items()):
        part = made.make(item)
        if part.height_mm is None:
            continue
        reader = readers.setdefault(
            item.condition.format, Reader(format=item.condition.format, orientation=Orientation.UPRIGHT)
        )
        for way, scan in ways(part, seed + number):
            try:
                reading = reader.touch.read_scan(scan)
            except MarksError:
                reading = None
            yield trial_of(reading, part=part.part, severity=severity, way=way, truth=part.truth)


def trial_of(reading: Reading | None, *, part: str, severity: float, way: str, truth: str) -> Trial:
    """Compare a reading, or none, with the truth; blanks do not count."""
    from rapidfuzz.distance import Levenshtein

    text = "" if reading is None else "".join(reading.text.split())
    accepted = reading is not None and reading.decision is Decision.ACCEPT
    right = max(0, len(truth) - int(Levenshtein.distance(text, truth)))
    return Trial(part, severity, way, len(truth), right, accepted)


def lost(trials: Sequence[Trial], way: str, *, against: str) -> tuple[float, float]:
    """Points of characters that a way loses to another on the same parts, and half the 95 % interval (Student)."""
    import numpy as np
    from scipy.stats import t

    theirs = {(one.part, one.severity): one for one in trials if one.way == against}
    points = np.array(
        [
            100.0 * (theirs[one.part, one.severity].right - one.right) / one.characters
            for one in trials
            if one.way == way
        ]
    )
    half = math.inf
    if points.size > 1:
        half = float(t.ppf(0.975, points.size - 1) * points.std(ddof=1) / np.sqrt(points.size))
    return float(points.mean()), half


def table(trials: Sequence[Trial], *, against: str) -> list[str]:
    """A line for each dirt and way: characters right, what was lost, serials.

    Intervals hold 95 %: of a share, exact (Clopper and Pearson); of what was lost, by the parts' differences (Student).
    """
    from scipy.stats import binomtest

    ways = list(dict.fromkeys(t.way for t in trials))
    wide = max(5, *(len(way) for way in ways))
    to = f"lost to {against}, points"
    lines = [
        f"dirt  {'way':<{wide}}  parts  characters, %            {to:>24}   parts that differ  accepted  wrong"
    ]
    for severity in sorted({t.severity for t in trials}):
        here = [t for t in trials if t.severity == severity]
        first = {t.part: t.right for t in here if t.way == against}
        for way in ways:
            own = [t for t in here if t.way == way]
            right, all_ = sum(t.right for t in own), sum(t.characters for t in own)
            share = binomtest(right, all_).proportion_ci(0.95, "exact")
            mean, half = lost(here, way, against=against)
            lines.append(
                f"{severity:<5g} {way:<{wide}} {len(own):>6}  {100.0 * right / all_:5.1f} "
                f"({100.0 * share.low:5.1f} to {100.0 * share.high:5.1f})  "
                f"{mean:6.2f} ({mean - half:5.2f} to {mean + half:5.2f})   "
                f"{sum(t.right != first[t.part] for t in own):>8}            "
                f"{sum(t.accepted for t in own):>6}  {sum(t.wrong_accepted for t in own):>5}"
            )
    return lines
