"""Whether parts are like others: two-sample tests of what was measured of them.

    certified parts --KindOfParts.of--> values of each measure ---+
                                                                  +--Kolmogorov-Smirnov--> Unlike, or nothing
    parts read --------------------> the latest of each measure --+

Each measure is tested by itself, at P_VALUE over their number (Bonferroni), so that all together cry wolf in no more
than P_VALUE of the tests.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from recognition.decision.evidence import Measure

P_VALUE = 1e-4
"""Chance that parts of the same kind are called unlike, at one test of all measures."""
LEAST_PARTS = 20
"""Fewer, on either side, are not compared."""
MOST_KEPT = 200
"""Values of a measure that are kept of more parts: so many quantiles."""


@dataclass(frozen=True)
class KindOfParts:
    """Distribution of each measure over some parts.

    Attributes:
        values: by measure, rising; of many parts evenly spaced quantiles.

    Raises:
        ValueError: values that are no numbers, or do not rise.
    """

    values: Mapping[Measure, tuple[float, ...]]

    def __post_init__(self) -> None:
        for name, values in self.values.items():
            if not all(math.isfinite(v) for v in values):
                raise ValueError(f"{name.value} is not a number everywhere")
            if list(values) != sorted(values):
                raise ValueError(f"the values of {name.value} do not rise")

    @classmethod
    def of(cls, parts: Collection[Mapping[Measure, float]]) -> KindOfParts:
        """The kind of these parts; measures that hardly any has are left out."""
        found = {}
        for name in Measure:
            values = np.sort([part[name] for part in parts if name in part])
            if values.size > MOST_KEPT:
                values = np.quantile(values, (np.arange(MOST_KEPT) + 0.5) / MOST_KEPT)
            if values.size >= LEAST_PARTS:
                found[name] = tuple(float(f"{v:.6g}") for v in values)
        return cls(found)


@dataclass(frozen=True)
class Unlike:
    """A difference between two sets of parts in one measure.

    Attributes:
        measure: which.
        certified: its median in those.
        now: its median in these.
        p: of the two-sample test.
        parts: how many these are.
    """

    measure: Measure
    certified: float
    now: float
    p: float
    parts: int

    def __str__(self) -> str:
        return (
            f"{self.measure.value} {self.now:.3g}, certified {self.certified:.3g} (medians, p = {self.p:.1g})"
        )


def unlike(kind: KindOfParts, parts: Collection[Mapping[Measure, float]]) -> tuple[Unlike, ...]:
    """The measures in which parts are not of a kind, the least likely first; none where they are too few to tell.

    Two-sample Kolmogorov-Smirnov test of each measure, exact where parts are few (`scipy.stats.ks_2samp`).
    """
    from scipy.stats import ks_2samp

    found = []
    for name, certified in kind.values.items():
        now = [part[name] for part in parts if name in part]
        if min(len(now), len(certified)) < LEAST_PARTS:
            continue
        p = float(ks_2samp(now, certified).pvalue)
        if p * len(kind.values) < P_VALUE:
            found.append(Unlike(name, float(np.median(certified)), float(np.median(now)), p, len(now)))
    return tuple(sorted(found, key=lambda one: one.p))
