"""Accuracy of coarser plans, as counted on simulated parts by `python tests/benchmarks/plan_accuracy.py`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from glyphs.surface.display import OneLine

MEASURED = Path(__file__).with_name("plan_accuracy.fit.json")
"""The counts and the command that measured them."""


@dataclass(frozen=True, repr=False)
class PlanCounts(OneLine):
    """Counts of parts and characters read by one plan, with traces in some directions, under one severity of dirt."""

    lines: int
    directions: tuple[int, ...]
    severity: float
    parts: int
    characters: int
    right: int
    accepted: int
    accepted_wrong: int

    @property
    def accuracy(self) -> float:
        return self.right / self.characters

    @property
    def spread(self) -> float:
        """Standard error of that share, if all characters are independent."""
        p = (self.right + 1.0) / (self.characters + 2.0)
        return math.sqrt(p * (1.0 - p) / self.characters)


@cache
def measured_plans() -> tuple[PlanCounts, ...]:
    """The counts of the package."""
    fit = json.loads(MEASURED.read_text(encoding="utf-8"))
    return tuple(PlanCounts(**{**each, "directions": tuple(each["directions"])}) for each in fit["counts"])


def describe_directions(directions: Sequence[int]) -> str:
    """Directions in words."""
    return ", ".join(f"{int(d)}°" for d in directions)
