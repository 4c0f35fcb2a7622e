"""A converter that samples all whiskers, and beside them whether the stage says that it touches.

sync   ____|^^^^^^|________|^^^^^^^^^^^^^^^^^|____      high: the stage's spare output
             air     lower      the pass       lift
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Record:
    """What was sampled between start and stop.

    Attributes:
        volts: (samples, whiskers).
        sync: (samples,) whether the stage's output was set.
        rate_hz: samples a second.
        clipped: (samples, whiskers) at an end of the converter's range.
    """

    volts: NDArray[np.float64]
    sync: NDArray[np.bool_]
    rate_hz: float
    clipped: NDArray[np.bool_]

    def stretches(self) -> list[slice]:
        """Where the stage's output was set, in time order."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], self.sync.astype(np.int8), [0]])))
        return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


class Daq(Protocol):
    """A converter."""

    @property
    def whiskers(self) -> int:
        """Channels that are whiskers."""

    def describe(self) -> str:
        """What it says it is."""

    def start(self) -> None:
        """Begin to sample.

        Raises:
            StageError: it cannot.
        """

    def stop(self) -> Record:
        """End, with all samples since the start.

        Raises:
            StageError: some were lost, or it does not answer.
        """

    def close(self) -> None:
        """Let it go; closing again does nothing."""
