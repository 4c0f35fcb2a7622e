"""From scores to posteriors: weights fitted on parts whose text is known.

The evidence of `evidence` sums over pixels that go together (a patch of grime covers hundreds), and the correlation of
`refine` sees what dirt tables cannot; how much each is worth was measured:

    log p(c | place) = w_e evidence_c + w_r log(1 - r_c^2) + constant

is a conditional logit, fitted by scikit-learn's logistic regression on the differences between the true character
and each rival (McFadden 1974). A share of belief is left for "nothing readable stands here".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Weights:
    """What scores are worth.

    Attributes:
        evidence: belief (in logarithm) a unit of evidence.
        residual: belief a unit of log(1 - r^2), <= 0.
        doubt: belief that nothing readable stands there, where the best template explains nothing.
        doubt_share: share of its ideal evidence at which the best template halves that belief.
        slip: least belief that a place is read wrongly, whatever the scores say: what no part has shown yet.
    """

    evidence: float
    residual: float
    doubt: float = 0.9
    doubt_share: float = 0.15
    slip: float = 2e-4

    def __post_init__(self) -> None:
        if not (self.evidence > 0.0 and self.residual <= 0.0):
            raise ValueError(f"{self}: evidence must count for, residuals against a character")
        if not (0.0 <= self.doubt < 1.0 and self.doubt_share > 0.0 and 0.0 <= self.slip < 0.5):
            raise ValueError(f"{self}: doubt and slip are probabilities, the share is positive")


DEFAULT_WEIGHTS = Weights(evidence=1.0 / 100.0, residual=-9.0)
"""Fitted on 1,680 places of parts of two unlike dirt generators (1/122 and -7.5, 1/92 and -5.6); the residual
rounded up for what correlation adds on clean places, where both fits have hardly a rival to learn from."""


@dataclass(frozen=True, eq=False)
class Scored:
    """What is known of one place, for the fit and for belief.

    Attributes:
        evidence: (C,) of each character.
        residual: (C,) log(1 - r^2) of each; 0 where correlation says nothing.
        ideal: (C,) evidence that each would have, standing there clean.
    """

    evidence: NDArray[np.float64]
    residual: NDArray[np.float64]
    ideal: NDArray[np.float64]


def residual_of(correlation: NDArray[np.float64]) -> NDArray[np.float64]:
    """log(1 - r^2): what a template leaves unexplained; negative correlations explain nothing."""
    return np.asarray(np.log(np.maximum(1.0 - np.clip(correlation, 0.0, 0.9999) ** 2, 1e-4)))


def log_beliefs(scored: Scored, weights: Weights = DEFAULT_WEIGHTS) -> NDArray[np.float64]:
    """Logarithms of the posteriors of a place's characters, (C,); they sum to less than 1."""
    raw = weights.evidence * scored.evidence + weights.residual * scored.residual
    top = float(raw.max())
    shares = np.exp(raw - top)
    shares = shares / shares.sum()
    # even the surest place may be one of a kind that the fit has not met
    shares = (1.0 - weights.slip) * shares + weights.slip / shares.size
    best = int(np.argmax(raw))
    explained = max(float(scored.evidence[best] / max(scored.ideal[best], 1e-9)), 0.0)
    nothing = weights.doubt / (1.0 + (explained / weights.doubt_share) ** 4)
    return np.asarray(np.log((1.0 - nothing) * shares))
