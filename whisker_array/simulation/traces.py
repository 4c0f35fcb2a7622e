"""Results of a trace, the same for all fidelities."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag, StrEnum

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine


class Fidelity(StrEnum):
    """Fidelities of simulation (docs/pages/physics.md)."""

    POINTWISE = "pointwise"
    CONTACT = "contact"


class SampleFlag(IntFlag):
    """Faults of one sample; 0 is a good sample. Only saturated moments are used in spite of their flag."""

    CONTACT_LOST = 1
    JAMMED = 2
    OUT_OF_RANGE = 4
    OUTSIDE = 8
    DROPOUT = 16
    NOT_CONVERGED = 32
    FAULTY = 64
    SATURATED = 128

    def describe(self) -> str:
        return "; ".join(text for flag, text in _MESSAGES.items() if flag in self) or "good"


LOST = np.uint8(SampleFlag.CONTACT_LOST)
JAMMED = np.uint8(SampleFlag.JAMMED)
_MESSAGES = {
    SampleFlag.CONTACT_LOST: "the whisker lost contact (raise the preload)",
    SampleFlag.JAMMED: "the tip jams on a wall (lower k = l2/l1, or the friction)",
    SampleFlag.OUT_OF_RANGE: "the signal left the converter's range (lower the gain or the preload)",
    SampleFlag.OUTSIDE: "the trace ran beyond the measured surface",
    SampleFlag.DROPOUT: "the height there is a dropout, filled from its surroundings",
    SampleFlag.NOT_CONVERGED: "the contact solver did not converge",
    SampleFlag.FAULTY: "the whisker or its wiring is faulty there (see its fault)",
    SampleFlag.SATURATED: "the signal stands still at the end of its range (lower the gain or the preload)",
}


@dataclass(frozen=True, eq=False, repr=False)
class Traces(OneLine):
    """Moments (lines or passes and whiskers, samples) of traces; 0 where contact is lost or the tip jams."""

    moment_n_mm: NDArray[np.float32]
    flags: NDArray[np.uint8]
