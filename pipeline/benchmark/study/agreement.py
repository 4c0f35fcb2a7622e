"""Attribute agreement analysis: within appraisers, between them, and against the truth.

             appraiser A      appraiser B        within    all trials of one appraiser alike
             1    2    3      1    2    3        between   all trials of all appraisers alike
    part 1   K4   K4   K4     K4   K4   K4       truth     all trials of one appraiser right; of all appraisers
    part 2   R7   B7   R7     R7   R7   R7

As in AIAG, *Measurement Systems Analysis*, 4th edition (2010), chapter III, section C; shares with the exact interval
of Clopper and Pearson, kappas as `pipeline.benchmark.study.kappa`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

from pipeline.benchmark.analysis.shares import Estimate
from pipeline.benchmark.study.kappa import fleiss_kappa, mean_cohen_kappa
from pipeline.common.shares import Share, share

Ratings = Mapping[str, Mapping[str, tuple[str, ...]]]
"""Ratings by appraiser and part, trial by trial: equally many of every part."""


class Kind(StrEnum):
    """Kinds of comparison."""

    WITHIN = "within"
    BETWEEN = "between"
    PAIR = "pair"
    TRUTH = "against truth"
    ALL_TRUTH = "all against truth"


@dataclass(frozen=True)
class Agreement:
    """Agreement of ratings.

    Attributes:
        kind: what is compared.
        who: the appraisers.
        parts: on which all ratings agree, of the parts compared; with the exact 95 % interval.
        kappa: within and between: Fleiss'. Of a pair, and against truth: the mean of Cohen's over the trials. None
            where it is not defined.
        disagreed: the parts on which they do not agree.
    """

    kind: Kind
    who: str
    parts: Share
    kappa: Estimate | None
    disagreed: tuple[str, ...]


def agreements(ratings: Ratings, truth: Mapping[str, str] | None = None) -> list[Agreement]:
    """Compute all comparisons that the ratings allow.

    Within needs an appraiser with several trials. Between and pairs use the parts that the appraisers have in common.
    Against truth uses the parts whose truth is known.

    Args:
        ratings: see `Ratings`.
        truth: correct rating by part, as far as known.

    Raises:
        ValueError: an appraiser did not rate every part equally often, and at least once.
    """
    for who, by_part in ratings.items():
        if len({len(trials) for trials in by_part.values()}) != 1 or not all(by_part.values()):
            raise ValueError(f"{who} did not rate every part equally often")
    several = {who: trials for who, trials in ratings.items() if len(next(iter(trials.values()))) > 1}
    found = [_agreement(Kind.WITHIN, {who: by_part}) for who, by_part in several.items()]
    if len(ratings) > 1:
        found.append(_agreement(Kind.BETWEEN, ratings))
    if len(ratings) > 2:
        found += [_agreement(Kind.PAIR, dict(two)) for two in combinations(ratings.items(), 2)]
    if truth:
        found += [_agreement(Kind.TRUTH, {who: by_part}, truth) for who, by_part in ratings.items()]
        if len(ratings) > 1:
            found.append(_agreement(Kind.ALL_TRUTH, ratings, truth))
    return found


def _agreement(kind: Kind, ratings: Ratings, truth: Mapping[str, str] | None = None) -> Agreement:
    """Agreement of appraisers on the parts that all have rated and, if asked for, whose truth is known."""
    first, *others = ratings.values()
    parts = [p for p in first if all(p in by for by in others) and (truth is None or p in truth)]
    # (appraisers, trials, parts)
    said = [
        [[by_part[part][k] for part in parts] for k in range(len(next(iter(by_part.values()))))]
        for by_part in ratings.values()
    ]
    trials = [trial for of_one in said for trial in of_one]
    right = [] if truth is None else [[truth[part] for part in parts]]
    rows = {part: [trial[k] for trial in (*right, *trials)] for k, part in enumerate(parts)}
    if kind in (Kind.WITHIN, Kind.BETWEEN):
        kappa = fleiss_kappa(list(rows.values()))
    else:
        kappa = mean_cohen_kappa([(a, right[0]) for a in trials] if right else list(zip(*said, strict=False)))
    disagreed = tuple(part for part, row in rows.items() if len(set(row)) > 1)
    agreed = share(len(rows) - len(disagreed), len(rows), exact=True)
    return Agreement(kind, ", ".join(ratings), agreed, kappa, disagreed)
