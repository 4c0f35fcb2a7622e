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
    """Samples between start and stop.

    Attributes:
        volts: (samples, whiskers) voltages.
        sync: (samples,) whether the stage's output was set.
        rate_hz: samples per second.
        clipped: (samples, whiskers) whether the sample is at an end of the converter's range.
    """

    volts: NDArray[np.float64]
    sync: NDArray[np.bool_]
    rate_hz: float
    clipped: NDArray[np.bool_]

    def stretches(self) -> list[slice]:
        """Stretches where the stage's output was set, in time order."""
        edges = np.flatnonzero(np.diff(np.concatenate([[0], self.sync.astype(np.int8), [0]])))
        return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


class Daq(Protocol):
    """A converter."""

    @property
    def whiskers(self) -> int:
        """Number of whisker channels."""

    def describe(self) -> str:
        """Identification string of the converter."""

    def start(self) -> None:
        """Start sampling.

        Raises:
            StageError: it cannot.
        """

    def stop(self) -> Record:
        """Stop sampling and return all samples since the start.

        Raises:
            StageError: samples were lost, or the converter does not answer.
        """

    def close(self) -> None:
        """Let it go; closing again does nothing."""
