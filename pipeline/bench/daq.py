"""A converter that samples all whiskers, and beside them whether the stage says that it touches.

    sync   ____|^^^^^^|________|^^^^^^^^^^^^^^^^^|____      high: the stage's spare output
                 air     lower      the pass       lift
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.settings import DaqSettings
from whisker_array.scan.stage_error import StageError


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


def open_daq(settings: DaqSettings, *, whiskers: int) -> Daq:
    """The converter of a bench.

    Raises:
        MissingExtraError: its library is not installed.
        StageError: it cannot be opened, or has another number of channels than there are whiskers.
    """
    from pipeline.bench.line_daq import LineDaq
    from pipeline.bench.ni_daq import NiDaq

    daq: Daq = LineDaq(settings) if settings.kind == "line" else NiDaq(settings)
    if daq.whiskers != whiskers:
        found = daq.whiskers
        daq.close()
        raise StageError(
            f"the converter has {found} channels for {whiskers} whiskers", "see [comb] and [daq] of the bench"
        )
    return daq
