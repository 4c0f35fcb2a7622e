"""What a belief is worth: the confidence that is shown, and on which a reading is accepted.

    belief (product of places and experts)  --log odds * slope + bias-->  confidence: the share that is right

    confidence
     1 |                 ,-     slope < 1: experts err together, so their product is too sure of itself
       |           ,--'         bias < 0: where it says even chances, fewer are right
       |      ,-'
     0 +----------------
       0     belief     1

Touch, the camera and both together each have their own. Rising everywhere, it
changes no order and ties nothing: a threshold of the one is a threshold of the other. It holds on the ground that it
was fitted on, parts whose measures were in its ranges; away from there a confidence shrinks towards even chances. The
numbers stand in `calibration.fit.json`, with what they were fitted on; `python tests/benchmarks/fit_confidence.py`
fits them and compares them with other ways.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

SOURCES = ("tactile", "vision", "fused")
"""Of readings."""
CALIBRATED = Path(__file__).with_name("calibration.fit.json")


@dataclass(frozen=True)
class Calibration:
    """Of one source of readings.

    Attributes:
        slope: of the log odds shown over those believed.
        bias: of the log odds shown where the odds believed are even.
        ground: least and most of each measure, by its name, of the parts that it was fitted on.

    Raises:
        ValueError: a slope that does not rise, numbers that are none, or a range without width.
    """

    slope: float = 1.0
    bias: float = 0.0
    ground: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (self.slope > 0.0 and math.isfinite(self.slope) and math.isfinite(self.bias)):
            raise ValueError(f"{self} is no calibration; the slope is a number above 0, the bias any")
        for name, (low, high) in self.ground.items():
            if not low < high:
                raise ValueError(f"the ground has no width in {name}: {low} to {high}")

    def confidence(self, belief: float) -> float:
        """That a text is right in which there is so much belief; 0 and 1 stay."""
        return _share(self.slope * _log_odds(belief) + self.bias)

    def beyond(self, name: str, value: float) -> float:
        """How far a measure lies off the ground, in its widths; 0 on it, or where it has no such range."""
        low, high = self.ground.get(name, (-math.inf, math.inf))
        off = max(low - value, value - high, 0.0)
        return off / (high - low) if off else 0.0

    def off(self, measures: Mapping[str, float]) -> float:
        """How far the measure lies off the ground that lies off it furthest."""
        return max((self.beyond(name, value) for name, value in measures.items()), default=0.0)

    def belief(self, confidence: float) -> float:
        """The belief behind a confidence."""
        return _share((_log_odds(confidence) - self.bias) / self.slope)


def shrunk(confidence: float, widths: float) -> float:
    """A confidence so many widths off the ground that it was fitted on: its log odds fall by as much and one."""
    return _share(_log_odds(confidence) / (1.0 + widths))


@cache
def calibration_of(source: str) -> Calibration:
    """Of readings from one of `SOURCES`, as it was fitted."""
    return Calibration(**json.loads(CALIBRATED.read_text(encoding="utf-8"))["calibrations"][source])


def _log_odds(share: float) -> float:
    if not 0.0 < share < 1.0:
        return math.inf if share >= 1.0 else -math.inf
    return math.log(share) - math.log1p(-share)


def _share(log_odds: float) -> float:
    if log_odds >= 0.0:
        return 1.0 / (1.0 + math.exp(-log_odds))
    return math.exp(log_odds) / (1.0 + math.exp(log_odds)) if log_odds > -700.0 else 0.0
