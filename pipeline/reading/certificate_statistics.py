"""Whether parts are like those that were certified, by their measures::

    certified parts --KindOfParts.of--> values of each measure ---+
                                                                  +--Kolmogorov-Smirnov--> Unlike, or nothing
    parts read ------------> latest values of each measure -------+

Each measure is tested by itself, at P_VALUE divided by the number of measures (Bonferroni). All measures together then
give a false alarm in at most P_VALUE of the tests. The certified threshold is that of `pipeline.common.accepted_risk`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from recognition.decide.score import Measure

P_VALUE = 1e-4
"""Chance of a false alarm on parts of the same kind, for one test of all measures."""
LEAST_PARTS = 20
"""Fewest parts on either side for a comparison."""


@dataclass(frozen=True)
class KindOfParts:
    """Distribution of each measure over some parts.

    Attributes:
        values: ascending values of each measure; for many parts, evenly spaced quantiles.

    Raises:
        ValueError: values that are not finite, or not ascending.
    """

    values: Mapping[Measure, tuple[float, ...]]

    def __post_init__(self) -> None:
        for name, values in self.values.items():
            if not all(math.isfinite(v) for v in values):
                raise ValueError(f"{name.value} has values that are not finite")
            if list(values) != sorted(values):
                raise ValueError(f"the values of {name.value} are not ascending")

    @classmethod
    def of(cls, parts: Collection[Mapping[Measure, float]], *, most_kept: int = 200) -> KindOfParts:
        """Compute the distributions over these parts, without measures that fewer than LEAST_PARTS have.

        Args:
            parts: measures of each part.
            most_kept: most values of a measure that are kept; of more parts, as many quantiles are kept.
        """
        found = {}
        for name in Measure:
            values = np.sort([part[name] for part in parts if name in part])
            if values.size > most_kept:
                values = np.quantile(values, (np.arange(most_kept) + 0.5) / most_kept)
            if values.size >= LEAST_PARTS:
                found[name] = tuple(float(f"{v:.6g}") for v in values)
        return cls(found)


@dataclass(frozen=True)
class Unlike:
    """A difference between two sets of parts in one measure.

    Attributes:
        measure: measure that differs.
        certified: median over the certified parts.
        now: median over the latest parts.
        p: p-value of the two-sample test.
        parts: number of latest parts.
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
    """Find the measures in which parts differ from a kind, lowest p-value first; none if there are too few parts.

    Each measure has a two-sample Kolmogorov-Smirnov test, exact for few parts (`scipy.stats.ks_2samp`).
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
