"""What steps of touch bring, fitted on parts that were felt by steps drawn at random (`recognition.active.gain`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.active.gain import Gain, WayGain, sureness
from recognition.active.moves import MOST, Way

STIFFNESS = 0.3
"""Of the fit: the inverse weight of its penalty, so that ways that were seldom taken stay near the usual one."""


@dataclass(frozen=True)
class Tried:
    """One step that was taken, and what came of it.

    Attributes:
        way: of the step.
        lines: of every way before it.
        confidences: of all looks before it.
        sure: whether the serial was sure within the looks that count.
        part: the part that it was taken on.
    """

    way: Way
    lines: Mapping[Way, int]
    confidences: tuple[float, ...]
    sure: bool
    part: str = ""


def fit_gain(tried: Sequence[Tried]) -> Gain:
    """The gain that explains best what came of the steps.

    Raises:
        ValueError: steps that were all in vain, or none.
    """
    from sklearn.linear_model import LogisticRegression

    found = np.array([one.sure for one in tried])
    if found.size == 0 or found.all() or not found.any():
        raise ValueError("a gain is fitted on steps of which some made the serial sure and some did not")
    model = LogisticRegression(C=1.0 / STIFFNESS, max_iter=2000)
    model.fit(np.array([_row(one) for one in tried]), found)
    slopes, usual = [float(v) for v in model.coef_[0]], float(model.intercept_[0])
    ways = {}
    for k, way in enumerate(Way):
        own, new, lines = slopes[3 * k : 3 * k + 3]
        ways[way] = WayGain(usual=usual + own, new=new, lines=lines)
    sure, surer, looks = slopes[3 * len(Way) :]
    return Gain(ways, sure, surer, looks)


def loss_nats(gain: Gain, tried: Sequence[Tried]) -> float:
    """Mean surprise of a gain by what came of the steps."""
    chances = [gain.chance(one.way, one.lines, one.confidences) for one in tried]
    return float(
        np.mean([-math.log(p if one.sure else 1.0 - p) for p, one in zip(chances, tried, strict=True)])
    )


def _row(one: Tried) -> NDArray[np.float64]:
    row = np.zeros(3 * len(Way) + 3)
    k, has, s = list(Way).index(one.way), one.lines.get(one.way, 0), sureness(one.confidences)
    row[3 * k : 3 * k + 3] = 1.0, float(not has), has / MOST
    row[-3:] = s, s * s, math.log2(len(one.confidences))
    return row
