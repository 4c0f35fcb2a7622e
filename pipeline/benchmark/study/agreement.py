"""Attribute agreement analysis: does an appraiser repeat itself, do appraisers agree, and are they right?

             appraiser A      appraiser B        within    all trials of one appraiser alike
             1    2    3      1    2    3        between   all trials of all appraisers alike
    part 1   K4   K4   K4     K4   K4   K4       truth     all trials of one appraiser right; of all appraisers
    part 2   R7   B7   R7     R7   R7   R7

As in AIAG, *Measurement Systems Analysis*, 4th edition (2010), chapter III, section C; shares with the exact interval
of Clopper and Pearson, kappas as `pipeline.benchmark.study.kappa`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

from pipeline.benchmark.study.kappa import Kappa, fleiss_kappa, mean_cohen_kappa
from pipeline.common.shares import Share, share

Ratings = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What each appraiser said of each part, trial by trial: equally often of every part."""


class Kind(StrEnum):
    """What is compared."""

    WITHIN = "within"
    BETWEEN = "between"
    PAIR = "pair"
    TRUTH = "against truth"
    ALL_TRUTH = "all against truth"


@dataclass(frozen=True)
class Agreement:
    """How far ratings agree.

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
    kappa: Kappa | None
    disagreed: tuple[str, ...]


def agreements(ratings: Ratings, truth: Mapping[str, str] | None = None) -> list[Agreement]:
    """All comparisons that the ratings allow.

    Within takes an appraiser with several trials; between and pairs take the parts that the appraisers have in
    common, and against truth those whose truth is known.

    Args:
        ratings: see `Ratings`.
        truth: right rating by part, as far as known.

    Raises:
        ValueError: an appraiser who did not rate every part equally often, and at least once.
    """
    for who, by_part in ratings.items():
        if len({len(trials) for trials in by_part.values()}) != 1 or not all(by_part.values()):
            raise ValueError(f"{who} did not rate every part equally often")
    found = [_within(who, by_part) for who, by_part in ratings.items() if len(_any(by_part)) > 1]
    if len(ratings) > 1:
        found.append(_between(ratings))
    if len(ratings) > 2:
        found += _pairs(ratings)
    if truth:
        found += [_against_truth(who, by_part, truth) for who, by_part in ratings.items()]
        if len(ratings) > 1:
            found.append(_all_against_truth(ratings, truth))
    return found


def _within(who: str, by_part: Mapping[str, tuple[str, ...]]) -> Agreement:
    return _agreement(Kind.WITHIN, who, by_part, fleiss_kappa(list(by_part.values())))


def _between(ratings: Ratings) -> Agreement:
    rows = {part: _of_all(ratings, part) for part in _common(ratings)}
    return _agreement(Kind.BETWEEN, ", ".join(ratings), rows, fleiss_kappa(list(rows.values())))


def _pairs(ratings: Ratings) -> Iterator[Agreement]:
    for first, second in combinations(ratings, 2):
        both = {who: ratings[who] for who in (first, second)}
        parts = _common(both)
        rows = {part: _of_all(both, part) for part in parts}
        trials = min(len(_any(by_part)) for by_part in both.values())
        paired = [tuple([both[who][part][k] for part in parts] for who in both) for k in range(trials)]
        kappa = mean_cohen_kappa([(a, b) for a, b in paired])
        yield _agreement(Kind.PAIR, f"{first}, {second}", rows, kappa)


def _against_truth(who: str, by_part: Mapping[str, tuple[str, ...]], truth: Mapping[str, str]) -> Agreement:
    parts = [part for part in by_part if part in truth]
    rows = {part: (truth[part], *by_part[part]) for part in parts}
    right = [truth[part] for part in parts]
    trials = [[by_part[part][k] for part in parts] for k in range(len(_any(by_part)))]
    return _agreement(Kind.TRUTH, who, rows, mean_cohen_kappa([(trial, right) for trial in trials]))


def _all_against_truth(ratings: Ratings, truth: Mapping[str, str]) -> Agreement:
    parts = [part for part in _common(ratings) if part in truth]
    rows = {part: (truth[part], *_of_all(ratings, part)) for part in parts}
    right = [truth[part] for part in parts]
    trials = [
        [by_part[part][k] for part in parts]
        for by_part in ratings.values()
        for k in range(len(_any(by_part)))
    ]
    kappa = mean_cohen_kappa([(trial, right) for trial in trials])
    return _agreement(Kind.ALL_TRUTH, ", ".join(ratings), rows, kappa)


def _agreement(kind: Kind, who: str, rows: Mapping[str, Sequence[str]], kappa: Kappa | None) -> Agreement:
    disagreed = tuple(part for part, said in rows.items() if len(set(said)) > 1)
    return Agreement(kind, who, share(len(rows) - len(disagreed), len(rows), exact=True), kappa, disagreed)


def _common(ratings: Ratings) -> list[str]:
    """The parts that all have rated."""
    first, *others = ratings.values()
    return [part for part in first if all(part in other for other in others)]


def _of_all(ratings: Ratings, part: str) -> tuple[str, ...]:
    return tuple(said for by_part in ratings.values() for said in by_part[part])


def _any(by_part: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    return next(iter(by_part.values()))
