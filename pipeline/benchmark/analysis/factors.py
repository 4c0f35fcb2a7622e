"""Effect of each level of a factor: its share of characters right minus the mean of the other levels.

A part may be read several times, with different facts given. Its readings are dependent, so whole parts are resampled
(cluster bootstrap), never single readings. A fact is compared on the same parts, with the same other facts: the effects
of two facts that were always given together cannot be separated, and are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.estimates import Estimate, draw_parts
from pipeline.benchmark.analysis.groups import characters_right, level_of, levels_in, ordered_levels
from pipeline.benchmark.exam.condition import GIVEN, Level, level_name
from pipeline.benchmark.trials.journal import Trial

ENOUGH_PARTS = 20
"""Least number of parts of a level for a reliable bootstrap interval; with fewer it is too narrow."""
_KNOWLEDGE = tuple(f"{name}_given" for name in GIVEN)


@dataclass(frozen=True)
class LevelEffect:
    """Effect of one level.

    Attributes:
        level: the level.
        parts: number of parts.
        characters: share of characters right.
        serials: share of serials right.
        difference: share of characters right minus the mean of the other levels.
    """

    level: Level
    parts: int
    characters: Estimate
    serials: Estimate
    difference: Estimate


@dataclass(frozen=True)
class FactorEffect:
    """Effect of one factor on one mode.

    Attributes:
        factor: name of the factor.
        mode: mode that read.
        levels: its levels, the costliest first.
    """

    factor: str
    mode: str
    levels: tuple[LevelEffect, ...]

    @property
    def spread(self) -> float:
        """Difference in characters right between the best and the worst level."""
        return self.levels[-1].characters.value - self.levels[0].characters.value

    @property
    def trusted(self) -> bool:
        """True if every level has enough parts for its intervals."""
        return min(e.parts for e in self.levels) >= ENOUGH_PARTS


def factor_name(factor: str) -> str:
    """Name of a factor for people."""
    named = {"severity": "dirt", **{name: name.replace("_given", " given?") for name in _KNOWLEDGE}}
    return named.get(
        factor, factor.removesuffix("_mm").removesuffix("_deg").replace("_", " ") + _unit(factor)
    )


def _unit(factor: str) -> str:
    return ", mm" if factor.endswith("_mm") else ", °" if factor.endswith("_deg") else ""


def factor_effects(trials: Sequence[Trial]) -> tuple[FactorEffect, ...]:
    """Effects of every factor with several levels, for every mode; within a mode the greatest first."""
    factors = [name for name, levels in levels_in(trials).items() if len(levels) > 1]
    found = []
    for mode in dict.fromkeys(t.mode for t in trials):
        own = [t for t in trials if t.mode == mode]
        effects = [effect for factor in factors if (effect := _effect(own, factor)) is not None]
        found += sorted(effects, key=lambda e: -e.spread)
    return tuple(found)


def _effect(trials: Sequence[Trial], factor: str) -> FactorEffect | None:
    """Effect on one mode; None if only one level can be compared."""
    members = list(_in_pairs(trials, factor)) if factor in _KNOWLEDGE else trials
    levels = ordered_levels(level_of(t, factor) for t in members)
    if len(levels) < 2:
        return None
    places = {part: k for k, part in enumerate(dict.fromkeys(t.part for t in members))}
    columns = {level: k for k, level in enumerate(levels)}
    # (parts, levels, characters right | characters | serials right | serials)
    counts = np.zeros((len(places), len(levels), 4))
    for t in members:
        counts[places[t.part], columns[level_of(t, factor)]] += (
            characters_right(t), len(t.truth), t.right, 1.0,
        )  # fmt: skip
    drawn = draw_parts(len(places))
    again = (drawn @ counts.reshape(len(places), -1)).reshape(-1, len(levels), 4)
    measured = counts.sum(axis=0)[None]
    effects = [
        LevelEffect(
            level=level,
            parts=int((counts[:, k, 3] > 0).sum()),
            characters=Estimate.of(_shares(measured, 0)[0, k], _shares(again, 0)[:, k]),
            serials=Estimate.of(_shares(measured, 2)[0, k], _shares(again, 2)[:, k]),
            difference=Estimate.of(_minus_others(measured, k)[0], _minus_others(again, k)),
        )
        for k, level in enumerate(levels)
    ]
    effects.sort(key=lambda e: (e.characters.value, level_name(e.level)))
    return FactorEffect(factor, trials[0].mode, tuple(effects))


def _in_pairs(trials: Sequence[Trial], factor: str) -> Iterator[Trial]:
    """Readings of parts that were read with and without a fact, with all other facts equal."""
    others = [name for name in _KNOWLEDGE if name != factor]

    def beside(trial: Trial) -> tuple[Level, ...]:
        return (trial.part, *(trial.levels.get(name) for name in others))

    met: dict[tuple[Level, ...], set[Level]] = {}
    for trial in trials:
        met.setdefault(beside(trial), set()).add(trial.levels.get(factor))
    return (trial for trial in trials if len(met[beside(trial)]) > 1)


def _shares(counts: NDArray[np.float64], column: int) -> NDArray[np.float64]:
    """(draws, levels) share; NaN if no part of the level was drawn."""
    total = counts[..., column + 1]
    return np.where(total > 0.0, counts[..., column] / np.maximum(total, 1.0), np.nan)


def _minus_others(counts: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    """(draws,) share of characters of a level minus the mean of the others; NaN if a level was not drawn."""
    shares = _shares(counts, 0)
    difference: NDArray[np.float64] = shares[:, k] - np.delete(shares, k, axis=1).mean(axis=1)
    return difference
