"""Posteriors at each step along a strip, and the posteriors of each place that follow from them.

strip (28 columns per character height) --recogniser--> Steps --places of the format--> PlaceBelief
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line
from recognition.recogniser.ctc import PlaceBelief, count_belief, place_belief

Floats = NDArray[np.float64]
EXPERTS = ("network", "templates")
"""Experts: the recogniser, and templates of fonts."""
FLOOR = 1e-6
"""Least probability of each character at a step: no single network rules a character out."""

RARE = 0.1
"""Prior of a sign relative to a letter or digit: only an eighth of real markings contain a sign."""
SHOWN = math.log(1e-4)
"""Log posterior that a character must reach at some step, otherwise it counts as absent from the line."""


@dataclass(frozen=True, eq=False)
class Steps:
    """Posteriors along a line; `log_blank` includes word gaps, `log_chars` counts small letters as capitals."""

    log_blank: Floats
    log_chars: Floats
    chars: str
    columns: Floats
    gap: Floats | None = None
    small: Floats | None = None
    view: int = 0
    expert: str = "network"

    __repr__ = one_line

    @classmethod
    def of(
        cls,
        blank: Floats,
        shares: Floats,
        chars: str,
        columns: Floats,
        *,
        gap: Floats | None = None,
        small: Floats | None = None,
        rare: str = "",
        expert: str = "network",
    ) -> Steps:
        prior = np.array([RARE if char in rare else 1.0 for char in chars])
        log_chars = np.log(shares * prior + FLOOR)
        return cls(np.log(blank + FLOOR), log_chars, chars, columns, gap, small, expert=expert)

    def places(self, allowed: Sequence[str]) -> PlaceBelief | None:
        if not allowed:
            return None
        table = np.array([[c in place for c in self.chars] for place in allowed], dtype=np.bool_)
        # most characters appear nowhere along the line; sums over them would be wasted work
        shown = self.log_chars.max(axis=0) > SHOWN
        shown |= (table & ~(table & shown).any(axis=1, keepdims=True)).any(axis=0)
        belief = place_belief(self.log_blank, self.log_chars[:, shown], table[:, shown])
        if belief is None:
            return None
        log = np.where(table, math.log(FLOOR), -np.inf)
        log[:, shown] = np.where(table[:, shown], np.maximum(belief.log_belief, math.log(FLOOR)), -np.inf)
        return replace(belief, log_belief=log - np.logaddexp.reduce(log, axis=1, keepdims=True))

    def count(self) -> Floats:
        """(n,) log posterior of the number of characters, from 0."""
        shown = self.log_chars.max(axis=0) > SHOWN
        return count_belief(self.log_blank, self.log_chars[:, shown if shown.any() else slice(0, 1)])
