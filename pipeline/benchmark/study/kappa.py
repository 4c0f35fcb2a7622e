"""Agreement beyond chance: Cohen's kappa of two, Fleiss' of many.

    kappa = (agreement - agreement by chance) / (1 - agreement by chance)

Cohen, "A coefficient of agreement for nominal scales", Educational and Psychological Measurement 20 (1960) 37-46;
Fleiss, "Measuring nominal scale agreement among many raters", Psychological Bulletin 76 (1971) 378-382. Where all
ratings are the same, chance explains everything and kappa is not defined. Intervals draw whole parts again
(`pipeline.benchmark.analysis.shares`). Where every part has a serial of its own hardly anything agrees by chance, and
kappa is the share that agrees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.shares import Estimate, draw_parts

_Floats = NDArray[np.float64]


def mean_cohen_kappa(pairs: Sequence[tuple[Sequence[str], Sequence[str]]]) -> Estimate | None:
    """Mean of Cohen's kappas over several pairs of ratings of the same parts; None where one is not defined.

    Args:
        pairs: of (parts,) ratings.
    """
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
    """Fleiss' kappa of parts that were rated equally often; None if it is not defined.

    Args:
        ratings: (parts, ratings of a part), at least two of each.

    Raises:
        ValueError: fewer than two ratings of a part, or not equally many of each.
    """
    if not ratings:
        return None
    m = len(ratings[0])
    if m < 2 or any(len(row) != m for row in ratings):
        raise ValueError("every part needs as many ratings, and at least two")
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
    """(parts, labels) 1 where a part was rated so."""
    return np.asarray(np.asarray(ratings)[:, None] == np.asarray(labels), dtype=np.float64)


def _beyond(agreed: _Floats, chance: _Floats) -> _Floats:
    """Kappa; NaN where chance explains everything."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(chance < 1.0 - 1e-12, (agreed - chance) / (1.0 - chance), np.nan)


def _with_interval(kappas: Callable[[_Floats], _Floats], parts: int) -> Estimate | None:
    """Kappa and its interval; `kappas` takes (draws, parts) how often each part counts and gives (draws,)."""
    value = float(kappas(np.ones((1, parts)))[0])
    if np.isnan(value):
        return None
    # parts drawn that all have one rating say nothing of kappa
    return Estimate.of(value, kappas(draw_parts(parts)))
