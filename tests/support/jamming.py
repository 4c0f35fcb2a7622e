"""A stage that jams between two passes."""

from __future__ import annotations

from whisker_array.scan.session import StageSession
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.passes import Pass


class Jamming:
    """A session that fails after so many passes, if it does.

    Attributes:
        felt: passes so far.
        closed: how often it was closed.
    """

    def __init__(
        self, within: StageSession, after: int | None = None, fault: type[Exception] = StageError
    ) -> None:
        self._within, self._after, self._fault, self.fitting = within, after, fault, within.fitting
        self.felt = self.closed = 0

    def feel(self, order: Pass) -> Sweep:
        if self.felt == self._after:
            raise self._fault("the array has jammed")
        self.felt += 1
        return self._within.feel(order)

    def close(self) -> None:
        self.closed += 1
        self._within.close()
