"""Posteriors step by step along a strip, and the posteriors of each place that follow from them.

strip (28 columns to a character height) --recogniser--> Steps --places of the format--> PlaceBelief
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line
from recognition.experts.ctc import PlaceBelief, count_belief, place_belief

Floats = NDArray[np.float64]
EXPERTS = ("network", "templates")
"""Experts on a place: the recogniser, and templates of fonts."""
FLOOR = 1e-6
"""Probability that a step leaves to everything: no character is ruled out by one network."""

RARE = 0.1
"""Prior of a sign against a letter or figure: an eighth of real markings hold one at all."""
SHOWN = math.log(1e-4)
"""Logarithm of the belief that a character reaches at some step, or it is taken to stand nowhere."""


@dataclass(frozen=True, eq=False)
class Steps:
    """Beliefs along a line.

    Attributes:
        log_blank: (steps,) natural logarithms: no new character.
        log_chars: (steps, C) of each of `chars`.
        chars: which.
        columns: (steps,) of the strip, where each step's middle lies.
        gap: (steps,) probability of a word gap, which `log_blank` includes; None where it was not computed.
        small: (steps,) belief in small letters, which `log_chars` counts as their capitals; None likewise.
        view: number of the view that was looked at, of several of one part.
        expert: one of `EXPERTS`.
    """

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
        """Make steps from probabilities, (steps,) and (steps, C).

        Args:
            blank, shares, chars, columns, gap, small: as the class has them, not yet logarithms.
            rare: signs that are rare on parts, where no format asks for them.
            expert: one of `EXPERTS`.
        """
        prior = np.array([RARE if char in rare else 1.0 for char in chars])
        log_chars = np.log(shares * prior + FLOOR)
        return cls(np.log(blank + FLOOR), log_chars, chars, columns, gap, small, expert=expert)

    def places(self, allowed: Sequence[str]) -> PlaceBelief | None:
        """Return the posteriors of so many places with these allowed characters; None where they have no room."""
        if not allowed:
            return None
        table = np.array([[c in place for c in self.chars] for place in allowed], dtype=np.bool_)
        # most characters show nowhere along the line; sums over them are much work for nothing
        shown = self.log_chars.max(axis=0) > SHOWN
        shown |= (table & ~(table & shown).any(axis=1, keepdims=True)).any(axis=0)
        found = place_belief(self.log_blank, self.log_chars[:, shown], table[:, shown])
        if found is None:
            return None
        log = np.where(table, math.log(FLOOR), -np.inf)
        log[:, shown] = np.where(table[:, shown], np.maximum(found.log_belief, math.log(FLOOR)), -np.inf)
        return replace(found, log_belief=log - np.logaddexp.reduce(log, axis=1, keepdims=True))

    def count(self) -> Floats:
        """(n,) log posterior of the number of characters, from 0."""
        shown = self.log_chars.max(axis=0) > SHOWN
        return count_belief(self.log_blank, self.log_chars[:, shown if shown.any() else slice(0, 1)])
