"""The score: the probability that the whole serial is right, of everything that is known of a reading.

    log odds of the text  --weight--+
    what the format allows --weight-+--sum--> log odds shown --> score, 0 to 1
    land, photograph -------weight--+

Each quantity counts along straight lines, always in one direction: a better one never lowers the score. Touch, the
camera and both together each have their own weights. They stand in `score.fit.json`, with what they were fitted on;
`python tests/benchmarks/fit_score.py` fits them and judges them on what a fit left out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from glyphs.errors import MarksError
from recognition.decision.decide import Decision
from recognition.decision.evidence import Measure, measures_of
from recognition.decision.flags import EXPLANATIONS, MEASURE_FLAGS, Finding, ReadingFlag
from recognition.decision.reading import Reading

SOURCES = ("tactile", "vision", "fused")
"""Sources of readings."""
FITTED = Path(__file__).with_name("score.fit.json")


@dataclass(frozen=True)
class Term:
    """Contribution of one quantity: straight lines between points, level beyond them.

    Attributes:
        usual: value that counts nothing.
        points: values, rising, and the log odds that each adds; these go in one direction.
    """

    usual: float
    points: Sequence[tuple[float, float]]

    def nats(self, value: float | None) -> float:
        """Log odds that a value adds; 0 where it is not known."""
        if value is None:
            return 0.0
        values, nats = np.array(self.points).T
        return float(np.interp(value, values, nats))


@dataclass(frozen=True)
class Score:
    """Weights of the quantities for one source of readings.

    Attributes:
        bias: log odds where everything is usual and the text's are even.
        terms: what each quantity counts; the log odds of the text, at least, rising.
        thresholds: risks, falling, and the least score from which readings that a fit left out kept each.
    """

    bias: float
    terms: Mapping[Measure, Term]
    thresholds: Sequence[tuple[float, float]] = ()

    def probability(self, measures: Mapping[Measure, float]) -> float:
        """Probability that a text is right; an unknown quantity counts as usual."""
        return share(self.bias + sum(term.nats(measures.get(name)) for name, term in self.terms.items()))

    def of_belief(self, belief: float) -> float:
        """Probability that a text is right, from its posterior alone."""
        return self.probability({Measure.ODDS: log_odds(belief)})

    def threshold(self, risk: float) -> float:
        """Least score from which the share of wrong ones among the accepted is expected to be no more than a risk.

        Raises:
            MarksError: a risk that the readings of the fit say nothing about.
        """
        kept = [threshold for least, threshold in self.thresholds if least <= risk]
        if not kept or not risk < 1.0:
            least = min((one for one, _ in self.thresholds), default=1.0)
            raise MarksError(
                f"a risk of {risk:g} is none that was tried; it lies between {least:g} and 1",
                hint="certify your own parts for a smaller one",
            )
        return kept[0]

    @property
    def slope(self) -> float:
        """Log odds per unit of the text's log odds, where the text is likelier than not."""
        (low, below), (high, above) = self.terms[Measure.ODDS].points[-2:]
        return (above - below) / (high - low)


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
    terms = {Measure[name]: Term(**values) for name, values in fitted["terms"].items()}
    return Score(fitted["bias"], MappingProxyType(terms), fitted["thresholds"])


def with_score(reading: Reading, *, without: frozenset[Measure] = frozenset()) -> Reading:
    """The reading with its score, and why it is low where it is below the threshold.

    Where touch has read nothing beside the camera, it is scored as a camera's.

    Args:
        reading: of one sense or both, with what it was made from in its trace.
        without: quantities that count as usual, to see what each is worth.
    """
    if not reading.characters:
        return reading
    score = score_of(reading.source)
    measures = {name: value for name, value in measures_of(reading).items() if name not in without}
    if Measure.ODDS not in measures and Measure.CAMERA in measures:
        score, measures[Measure.ODDS] = score_of("vision"), measures[Measure.CAMERA]
    made = replace(reading, confidence=score.probability(measures))
    if made.threshold is None or made.confidence >= made.threshold:
        return made.without_flags(EXPLANATIONS)
    low = ReadingFlag.LOW_CONFIDENCE
    # what each quantity beside the text's costs against a usual value
    beside = {
        name: term for name, term in score.terms.items() if name in measures and name is not Measure.ODDS
    }
    losses = ((-term.nats(measures[name]), name) for name, term in beside.items())
    loss, name = max(losses, default=(0.0, Measure.ODDS))
    if not made.findings and share(log_odds(made.confidence) + loss) >= made.threshold:
        usual = score.terms[name].usual
        text = f"unlike most parts: {name.value} {measures[name]:.2g}, usually {usual:.2g} (look at the part)"
        return made.with_findings(Finding(low, text))
    return replace(made, flags=made.flags | low)


def serial_is_sure(reading: Reading) -> bool:
    """Whether another scan reads nothing better: it is accepted but for rules for its mark and its orientation."""
    beside = MEASURE_FLAGS | ReadingFlag.ORIENTATION_UNKNOWN
    return replace(reading, flags=reading.flags & ~beside).decision is Decision.ACCEPT
