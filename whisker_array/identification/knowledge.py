"""Uncertainty of the numbers of a whisker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glyphs.ranges import freeze_arrays
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats
from whisker_array.identification.bench import DRAWN, Unknown
from whisker_array.identification.fit import Identified
from whisker_array.whisker.sections import WhiskerError

OF_WHISKER = (*DRAWN, Unknown.RADIUS, Unknown.PRELOAD, Unknown.FRICTION)
"""Numbers of a whisker that stay the same from part to part."""


@dataclass(frozen=True, eq=False, repr=False)
class Knowledge(OneLine):
    """Covariance (n, n) of those numbers of a whisker that are uncertain; the stiffness is relative to its own."""

    names: tuple[Unknown, ...]
    covariance: Floats

    def __post_init__(self) -> None:
        n = len(self.names)
        if not set(self.names) <= set(OF_WHISKER) or len(set(self.names)) != n:
            raise WhiskerError(
                "an identified whisker has an unknown number, or one twice",
                hint=f"name each of {', '.join(OF_WHISKER)} at most once",
            )
        freeze_arrays(WhiskerError, self, {"covariance": (n, n)})
        if (np.diag(self.covariance) < 0.0).any():
            raise WhiskerError("covariance has a negative variance", hint="give a covariance of the numbers")

    @property
    def sd(self) -> Floats:
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def knowledge_of(identified: Identified) -> Knowledge:
    """Take the covariance of the whisker's numbers from an identification."""
    names = OF_WHISKER if identified.drawn is not None else tuple(n for n in OF_WHISKER if n not in DRAWN)
    rows = [list(Unknown).index(name) for name in names]
    scale = np.array([identified.bench[name] if name is Unknown.STIFFNESS else 1.0 for name in names])
    return Knowledge(names, identified.covariance[np.ix_(rows, rows)] / np.outer(scale, scale))
