"""Whether parts are like those that were certified: each measure is tested by itself (Kolmogorov and Smirnov), at
P_VALUE divided by the number of measures (Bonferroni)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from recognition.decide.score import Measure

P_VALUE = 1e-4  # chance of a false alarm on parts of the same kind, for one test of all measures
LEAST_PARTS = 20  # on either side of a comparison


@dataclass(frozen=True)
class KindOfParts:
    """Ascending values of each measure over some parts, or quantiles of many. Raises ValueError."""

    values: Mapping[Measure, tuple[float, ...]]

    def __post_init__(self) -> None:
        for name, values in self.values.items():
            if not all(math.isfinite(v) for v in values):
                raise ValueError(f"{name.value} has values that are not finite")
            if list(values) != sorted(values):
                raise ValueError(f"the values of {name.value} are not ascending")

    @classmethod
    def of(cls, parts: Collection[Mapping[Measure, float]], *, most_kept: int = 200) -> KindOfParts:
        """Compute the distributions, at most `most_kept` values each, of measures that LEAST_PARTS or more have."""
        quantiles = {}
        for name in Measure:
            values = np.sort([part[name] for part in parts if name in part])
            if values.size > most_kept:
                values = np.quantile(values, (np.arange(most_kept) + 0.5) / most_kept)
            if values.size >= LEAST_PARTS:
                quantiles[name] = tuple(float(f"{v:.6g}") for v in values)
        return cls(quantiles)


@dataclass(frozen=True)
class Unlike:
    """A measure that differs: medians over the certified and the latest `parts`, p-value of the two-sample test."""

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
    """Find the measures in which enough parts differ from a kind (`scipy.stats.ks_2samp`), lowest p-value first."""
    from scipy.stats import ks_2samp

    differing = []
    for name, certified in kind.values.items():
        now = [part[name] for part in parts if name in part]
        if min(len(now), len(certified)) < LEAST_PARTS:
            continue
        p = float(ks_2samp(now, certified).pvalue)
        if p * len(kind.values) < P_VALUE:
            differing.append(Unlike(name, float(np.median(certified)), float(np.median(now)), p, len(now)))
    return tuple(sorted(differing, key=lambda measure: measure.p))
