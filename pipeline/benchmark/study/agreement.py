"""Attribute agreement analysis: within appraisers, between them, and against the truth; kappas.

             appraiser A      appraiser B        within    all trials of one appraiser the same
             1    2    3      1    2    3        between   all trials of all appraisers the same
    part 1   K4   K4   K4     K4   K4   K4       truth     all trials of one appraiser right; of all appraisers
    part 2   R7   B7   R7     R7   R7   R7

As in AIAG, *Measurement Systems Analysis*, 4th edition (2010), chapter III, section C; shares with the exact interval
of Clopper and Pearson. Agreement beyond chance: Cohen's kappa for two appraisers, Fleiss' for more,

    kappa = (agreement - agreement by chance) / (1 - agreement by chance)

Cohen, "A coefficient of agreement for nominal scales", Educational and Psychological Measurement 20 (1960) 37-46;
Fleiss, "Measuring nominal scale agreement among many raters", Psychological Bulletin 76 (1971) 378-382. If all ratings
are the same, kappa is not defined. Intervals resample whole parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.estimates import Estimate, resample
from pipeline.common.shares import Share, share

_Floats = NDArray[np.float64]


def mean_cohen_kappa(pairs: Sequence[tuple[Sequence[str], Sequence[str]]]) -> Estimate | None:
    """Mean of Cohen's kappas over several pairs of (parts,) ratings of the same parts; None if one is not defined."""
    if not pairs or not pairs[0][0]:
        return None
    hot = [(_one_hot(a, labels), _one_hot(b, labels)) for a, b in pairs for labels in [sorted({*a, *b})]]

    def kappas(drawn: _Floats) -> _Floats:
        n = drawn.sum(axis=1)
        each = []
        for a, b in hot:
            agreed = drawn @ (a * b).sum(axis=1) / n
            chance = ((drawn @ a) * (drawn @ b)).sum(axis=1) / n**2
            each.append(_beyond(agreed, chance))
        return np.asarray(np.mean(each, axis=0))

    return _with_interval(kappas, len(pairs[0][0]))


def fleiss_kappa(ratings: Sequence[Sequence[str]]) -> Estimate | None:
    """Fleiss' kappa of (parts, ratings of a part), equally many (ValueError) of each; None if it is not defined."""
    if not ratings:
        return None
    m = len(ratings[0])
    if m < 2 or any(len(row) != m for row in ratings):
        raise ValueError("every part needs the same number of ratings, at least two")
    labels = sorted({label for row in ratings for label in row})
    counts = np.sum([_one_hot([row[k] for row in ratings], labels) for k in range(m)], axis=0)
    # share of a part's pairs of ratings that agree
    alike = ((counts**2).sum(axis=1) - m) / (m * (m - 1))

    def kappas(drawn: _Floats) -> _Floats:
        n = drawn.sum(axis=1)
        chance = ((drawn @ counts / (n * m)[:, None]) ** 2).sum(axis=1)
        return _beyond(drawn @ alike / n, chance)

    return _with_interval(kappas, len(ratings))


def _one_hot(ratings: Sequence[str], labels: Sequence[str]) -> _Floats:
    return np.asarray(np.asarray(ratings)[:, None] == np.asarray(labels), dtype=np.float64)


def _beyond(agreed: _Floats, chance: _Floats) -> _Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(chance < 1.0 - 1e-12, (agreed - chance) / (1.0 - chance), np.nan)


def _with_interval(kappas: Callable[[_Floats], _Floats], parts: int) -> Estimate | None:
    """Kappa and its interval; `kappas` maps weights of the parts (draws, parts) to kappas (draws,)."""
    kappa = resample(np.eye(parts), kappas, least=-1.0)
    return None if np.isnan(kappa.value) else kappa


# by appraiser and part, trial by trial; an appraiser rates every part equally often
Ratings = Mapping[str, Mapping[str, tuple[str, ...]]]


class Kind(StrEnum):
    """Kinds of comparison."""

    WITHIN = "within"
    BETWEEN = "between"
    PAIR = "pair"
    TRUTH = "against truth"
    ALL_TRUTH = "all against truth"


@dataclass(frozen=True)
class Agreement:
    """Agreement of ratings by some appraisers."""

    kind: Kind
    who: str
    parts: Share  # share of those compared on which all ratings agree, with the exact 95 % interval
    # Fleiss' within and between; for a pair and against truth the mean of Cohen's over trials
    kappa: Estimate | None
    disagreed: tuple[str, ...]


def agreements(ratings: Ratings, truth: Mapping[str, str] | None = None) -> list[Agreement]:
    """Compute all comparisons that the ratings and the truth by part allow. "Within" needs an appraiser with several
    trials. "Between" and "pair" use the common parts. Raises ValueError: a part was not rated equally often."""
    for who, by_part in ratings.items():
        if len({len(trials) for trials in by_part.values()}) != 1 or not all(by_part.values()):
            raise ValueError(f"{who} did not rate every part equally often")
    several = {who: trials for who, trials in ratings.items() if len(next(iter(trials.values()))) > 1}
    compared = [_agreement(Kind.WITHIN, {who: by_part}) for who, by_part in several.items()]
    if len(ratings) > 1:
        compared.append(_agreement(Kind.BETWEEN, ratings))
    if len(ratings) > 2:
        compared += [_agreement(Kind.PAIR, dict(two)) for two in combinations(ratings.items(), 2)]
    if truth:
        compared += [_agreement(Kind.TRUTH, {who: by_part}, truth) for who, by_part in ratings.items()]
        if len(ratings) > 1:
            compared.append(_agreement(Kind.ALL_TRUTH, ratings, truth))
    return compared


def _agreement(kind: Kind, ratings: Ratings, truth: Mapping[str, str] | None = None) -> Agreement:
    first, *others = ratings.values()
    parts = [p for p in first if all(p in by for by in others) and (truth is None or p in truth)]
    # (appraisers, trials, parts)
    texts = [
        [[by_part[part][k] for part in parts] for k in range(len(next(iter(by_part.values()))))]
        for by_part in ratings.values()
    ]
    trials = [trial for appraiser in texts for trial in appraiser]
    right = [] if truth is None else [[truth[part] for part in parts]]
    rows = {part: [trial[k] for trial in (*right, *trials)] for k, part in enumerate(parts)}
    if kind in (Kind.WITHIN, Kind.BETWEEN):
        kappa = fleiss_kappa(list(rows.values()))
    else:
        kappa = mean_cohen_kappa(
            [(a, right[0]) for a in trials] if right else list(zip(*texts, strict=False))
        )
    disagreed = tuple(part for part, row in rows.items() if len(set(row)) > 1)
    agreed = share(len(rows) - len(disagreed), len(rows), exact=True)
    return Agreement(kind, ", ".join(ratings), agreed, kappa, disagreed)
