"""Effect of each level of a factor: its share of characters right minus the mean of the other levels.

Whole parts are resampled (cluster bootstrap). Whether a factor matters is tested by the ranks of the parts' shares less
the mean of their severity (Kruskal and Wallis), corrected for the number of factors (Holm).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.estimates import Estimate, holm, ratio, resample
from pipeline.benchmark.analysis.groups import characters_right, level_of, levels_in, ordered_levels
from pipeline.benchmark.exam.condition import Level, level_name
from pipeline.benchmark.trials.journal import Trial


@dataclass(frozen=True)
class LevelEffect:
    """Effect of one level; `difference` is its share of characters right minus the mean of the other levels."""

    level: Level
    parts: int
    characters: Estimate
    serials: Estimate
    difference: Estimate


@dataclass(frozen=True)
class FactorEffect:
    """Effect of one factor on one mode: its levels, the costliest first."""

    factor: str
    mode: str
    levels: tuple[LevelEffect, ...]
    p_matters: float  # of such effects if the factor had none, corrected for the mode's factors (Holm)

    @property
    def spread(self) -> float:
        return self.levels[-1].characters.value - self.levels[0].characters.value


def factor_name(factor: str) -> str:
    """Name of a factor for people."""
    plain = factor.removesuffix("_mm").removesuffix("_deg").replace("_", " ") + _unit(factor)
    return "dirt" if factor == "severity" else plain


def _unit(factor: str) -> str:
    return ", mm" if factor.endswith("_mm") else ", °" if factor.endswith("_deg") else ""


def factor_effects(trials: Sequence[Trial]) -> tuple[FactorEffect, ...]:
    """Effects of every factor with several levels, for every mode; within a mode the greatest first."""
    factors = [n for n, levels in levels_in(trials).items() if len(levels) > 1 and not n.endswith("_given")]
    effects: list[FactorEffect] = []
    for mode in dict.fromkeys(t.mode for t in trials):
        of_mode = [t for t in trials if t.mode == mode]
        single = [_effect(of_mode, factor) for factor in factors]
        corrected = zip(single, holm([e.p_matters for e in single]), strict=True)
        effects += sorted((replace(e, p_matters=p) for e, p in corrected), key=lambda e: -e.spread)
    return tuple(effects)


def _effect(trials: Sequence[Trial], factor: str) -> FactorEffect:
    levels = ordered_levels(level_of(t, factor) for t in trials)
    severities = {t.part: t.severity for t in trials}
    places = {part: k for k, part in enumerate(severities)}
    columns = {level: k for k, level in enumerate(levels)}
    # (parts, levels, characters right | characters | serials right | serials)
    counts = np.zeros((len(places), len(levels), 4))
    for t in trials:
        counts[places[t.part], columns[level_of(t, factor)]] += (
            characters_right(t), len(t.truth), t.right, 1.0,
        )  # fmt: skip
    effects = []
    for k, level in enumerate(levels):
        of_level = counts[counts[:, k, 3] > 0.0, k]
        effects.append(
            LevelEffect(
                level=level,
                parts=len(of_level),
                characters=resample(of_level[:, :2], ratio),
                serials=resample(of_level[:, 2:], ratio),
                difference=resample(
                    counts[..., :2].reshape(len(counts), -1),
                    partial(_minus_others, k=k),
                    parts=len(of_level),
                    least=-1.0,
                ),
            )
        )
    effects.sort(key=lambda e: (e.characters.value, level_name(e.level)))
    blocks = [None if factor == "severity" else severities[part] for part in places]
    return FactorEffect(factor, trials[0].mode, tuple(effects), _p_matters(counts, blocks))


def _p_matters(counts: NDArray[np.float64], severities: Sequence[float | None]) -> float:
    """Whether levels differ, by counts as in `_effect`, apart from differences between severities (parts,)."""
    from scipy.stats import kruskal

    read = counts[..., 3] > 0.0
    part_shares = counts[..., 0].sum(axis=1) / np.maximum(1.0, counts[..., 1].sum(axis=1))
    for severity in dict.fromkeys(severities):
        same = np.array([s == severity for s in severities])
        part_shares[same] -= part_shares[same].mean()
    part_shares = part_shares.round(9)  # equal shares remain ties
    if not np.ptp(part_shares):
        return 1.0
    return float(kruskal(*(part_shares[read[:, k]] for k in range(read.shape[1]))).pvalue)


def _minus_others(sums: NDArray[np.float64], *, k: int) -> NDArray[np.float64]:
    """(draws,) share of characters of a level minus the mean of the others; NaN if a level was not drawn."""
    shares = ratio(sums.reshape(-1, 2)).reshape(len(sums), -1)
    difference: NDArray[np.float64] = shares[:, k] - np.delete(shares, k, axis=1).mean(axis=1)
    return difference
