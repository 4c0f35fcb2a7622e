"""Expected gain of a step: the chance that the serial is sure within the next few looks.

    chance = 1 / (1 + exp(-z)),   z = way + new + slope lines/16 + a s + b s^2 + c log2(looks)

s is the logarithm of the best confidence of the last three looks, scaled: 0 at a confidence of 1e-4, 1 at 1. `python
tests/benchmarks/fit_gain.py` fits `gain.fit.json` on simulated parts that are felt by random steps.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from recognition.active.moves import MOST, Way

FITTED = Path(__file__).with_name("gain.fit.json")
LOOKS_AHEAD = 4
"""Number of looks within which a step must make the serial sure."""
_LEAST = 1e-4
"""Confidence at which s is 0; lower ones count as this."""


@dataclass(frozen=True)
class WayGain:
    """Coefficients of one way; `lines` is the factor of its lines so far, as a share of `MOST`."""

    usual: float
    new: float
    lines: float


@dataclass(frozen=True)
class Gain:
    """Expected gains of steps; `sure` is the factor of s, `surer` that of s squared."""

    ways: Mapping[Way, WayGain]
    sure: float
    surer: float
    looks: float

    def chance(self, way: Way, lines: Mapping[Way, int], confidences: Sequence[float]) -> float:
        """Probability that the serial is sure within `LOOKS_AHEAD` looks if the next step goes this way."""
        gain = self.ways[way]
        has = lines.get(way, 0)
        s = sureness(confidences)
        z = gain.usual + (gain.new if not has else 0.0) + gain.lines * has / MOST
        z += self.sure * s + self.surer * s * s + self.looks * math.log2(len(confidences))
        return 1.0 / (1.0 + math.exp(-z))


def sureness(confidences: Sequence[float], *, recent: int = 3) -> float:
    """Compute s, which the module docstring defines."""
    best = max(confidences[-recent:])
    return 1.0 + math.log10(max(best, _LEAST)) / 4.0


@cache
def fitted_gain() -> Gain:
    """Load the fitted model."""
    fitted = json.loads(FITTED.read_text(encoding="utf-8"))["gain"]
    ways = {Way(name): WayGain(**numbers) for name, numbers in fitted["ways"].items()}
    return Gain(ways, fitted["sure"], fitted["surer"], fitted["looks"])
