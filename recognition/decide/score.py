"""The score: the probability that the whole serial is right, from some measures of a reading.

    log odds of the text ------weight--+
    the same by touch alone ---weight--+
    whether a format is given -weight--+--sum--> log odds --> probability --+
    characters with a twin ----weight--+                                    |
    it is a piece of another --weight--+                                    +--lesser--> score, 0 to 1
                                                                            |
    probability of the least sure place ------------------------------------+

Each term is a piecewise linear curve that only rises or only falls: a better value never lowers the score. Each source
has its own weights. Both senses score no less than either alone: dirt before the camera makes touch no less sure.

For each risk the fit keeps the least score at which readings of generators that the fit had left out were wrong no more
often. Weights and thresholds are in `score.fit.json`; `python tests/benchmarks/fit_score.py` fits them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from recognition.decide.risk_text import check_risk

SOURCES = ("tactile", "vision", "fused")
FITTED = Path(__file__).with_name("score.fit.json")
DIGITS = 6
"""Decimals of a score in records; certificates are computed from records."""


class Measure(StrEnum):
    """Measures of a part; the value is the name in messages and tables."""

    CONFIDENCE = "confidence"
    ODDS = "log odds of the text before anything else is known"
    LEAST_SURE = "probability of the least sure place"
    FORMAT_GIVEN = "1 with a format, 0 without"
    TWINS = "characters whose twin (0 and O, 1 and I, 5 and S) would fit as well"
    PIECE = "log probability of a character of which the one read is a piece"
    BY_TOUCH = "log odds of the text by touch alone"
    MARGIN = "least margin"
    BELIEF = "belief before the format"
    EVIDENCE = "evidence against the strongest rival (nats)"
    FORMAT = "log probability of all that the format allows"
    STROKES = "share of strokes felt"
    LEAST_STROKES = "share of the strokes felt of the character that has the least"
    COVERED = "greatest share of deciding strokes that are covered"
    UNLIKENESS = "share of the marks that known fonts leave unexplained"
    HEIGHT = "character height (mm)"
    DEPTH = "mean depth (mm)"
    FINE = "fine roughness (µm)"
    COARSE = "coarse roughness (µm)"
    FINE_SHARE = "fine roughness in parts of the marks' depth"
    COARSE_SHARE = "coarse roughness in parts of the marks' depth"
    GRAIN = "grain of the photograph"
    PATCHES = "patches of the photograph"


@dataclass(frozen=True)
class Term:
    """Contribution of one measure: log odds at rising values, piecewise linear, constant beyond the ends."""

    points: Sequence[tuple[float, float]]

    def nats(self, value: float | None) -> float:
        """Log odds added by a value; 0 if unknown."""
        if value is None:
            return 0.0
        values, nats = np.array(self.points).T
        return float(np.interp(value, values, nats))


@dataclass(frozen=True)
class RiskThreshold:
    """The threshold of a risk, and its one-sided 95 % bound of wrong readings of left-out generators."""

    risk: float
    threshold: float
    accepted: int
    wrong: int
    bound: float


@dataclass(frozen=True)
class Score:
    """Score of one source of readings, by terms; its tested thresholds end with the strictest risk."""

    source: str
    bias: float
    terms: Mapping[Measure, Term]
    thresholds: Sequence[RiskThreshold] = ()

    def probability(self, measures: Mapping[Measure, float]) -> float:
        """Probability that a text is right, never above that of its least sure place; unknown measures add nothing."""
        odds = self.bias + sum(term.nats(measures.get(name)) for name, term in self.terms.items())
        return min(share(odds), measures.get(Measure.LEAST_SURE, 1.0))

    def threshold(self, risk: float) -> float | None:
        """Least score of readings that keep a risk; None if it was not shown to be kept at any score."""
        check_risk(risk)
        return min((test.threshold for test in self.thresholds if test.risk <= risk), default=None)

    @property
    def least_threshold(self) -> float:
        return min((test.threshold for test in self.thresholds), default=1.0)

    @property
    def least_risk(self) -> float:
        return min((test.risk for test in self.thresholds), default=1.0)

    @property
    def slope(self) -> float:
        """Log odds per unit of the text's log odds, if its probability is above 0.5."""
        (low, below), (high, above) = self.terms[Measure.ODDS].points[-2:]
        return (above - below) / (high - low)


SENSE_NAMES = MappingProxyType(
    {"tactile": "touch", "vision": "the camera", "fused": "touch and camera together"}
)


def log_odds(belief: float) -> float:
    """Return the log odds of a probability; infinite for 0 and 1."""
    if not 0.0 < belief < 1.0:
        return math.inf if belief >= 1.0 else -math.inf
    return math.log(belief) - math.log1p(-belief)


def share(odds: float) -> float:
    """The probability of log odds."""
    return 1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0


@cache
def score_of(source: str) -> Score:
    """Load the fitted score for one of `SOURCES`."""
    fitted = json.loads(FITTED.read_text(encoding="utf-8"))["scores"][source]
    terms = {Measure[name]: Term(points) for name, points in fitted["terms"].items()}
    thresholds = tuple(RiskThreshold(**tested) for tested in fitted["thresholds"])
    return Score(source, fitted["bias"], MappingProxyType(terms), thresholds)
