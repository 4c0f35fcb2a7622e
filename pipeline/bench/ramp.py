"""A straight move of a stage: it speeds up, runs evenly, slows down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Ramp:
    """A move from rest to rest.

    ::

        speed |    ______________
              |   /              \\          all of it within distance_mm
              |__/                \\____

    Attributes:
        distance_mm: length of the move.
        speed_mm_s: maximum speed.
        acceleration_mm_s2: acceleration and deceleration.
    """

    distance_mm: float
    speed_mm_s: float
    acceleration_mm_s2: float

    @property
    def peak_mm_s(self) -> float:
        """Highest speed reached."""
        return min(self.speed_mm_s, math.sqrt(self.distance_mm * self.acceleration_mm_s2))

    @property
    def duration_s(self) -> float:
        """Duration of the whole move."""
        peak = self.peak_mm_s
        return self.distance_mm / peak + peak / self.acceleration_mm_s2 if peak > 0.0 else 0.0

    def at_mm(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distance run after each time, from 0 to the whole."""
        peak, total = self.peak_mm_s, self.duration_s
        if total == 0.0:
            return np.zeros_like(time_s)
        t = np.clip(time_s, 0.0, total)
        up = peak / self.acceleration_mm_s2
        early = 0.5 * self.acceleration_mm_s2 * np.minimum(t, up) ** 2
        late = 0.5 * self.acceleration_mm_s2 * np.maximum(t - (total - up), 0.0) ** 2
        return np.asarray(early + peak * np.maximum(t - up, 0.0) - late)
