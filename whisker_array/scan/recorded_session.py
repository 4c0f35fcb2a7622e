"""Stage sessions for recordings: one records the passes of another session, one replays them.

KeptSession(stage's session).feel(pass) ...  --passes--> PassLog, recording
RecordedSession(scan).feel(the same pass) ... --> the same samples
"""

from __future__ import annotations

import numpy as np

from whisker_array.scan.scan import Scan
from whisker_array.scan.session import Fitting, StageSession
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.passes import Pass


class KeptSession:
    """A session that records the passes of another one.

    Attributes:
        felt: passes and their samples, in order.
    """

    def __init__(self, session: StageSession) -> None:
        """Wrap a session."""
        self._session = session
        self.felt: list[tuple[Pass, Sweep]] = []

    @property
    def fitting(self) -> Fitting:
        """Fitting of the wrapped session."""
        return self._session.fitting

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass and record it.

        Raises:
            StageError: the pass failed.
        """
        sweep = self._session.feel(order)
        self.felt.append((order, sweep))
        return sweep

    def close(self) -> None:
        """Close the wrapped session."""
        self._session.close()


class RecordedSession:
    """A `StageSession` that replays a recording with its log of passes, in order.

    If the stage failed after the last pass, the replay fails with the same message.

    Attributes:
        fitting: fitting of the recording, with its present calibration.
    """

    def __init__(self, scan: Scan) -> None:
        """Prepare the replay of a recording.

        Raises:
            StageError: the recording has no log of passes.
        """
        if scan.log is None:
            raise StageError("the recording has no log of passes", "read it as a whole")
        self._log, self._next = scan.log, 0
        self.fitting = Fitting(
            touch=scan.touch,
            array=scan.log.array,
            height_mm=scan.log.height_mm,
            field_mm=scan.log.field_mm,
            calibration=scan.calibration,
            fidelity=scan.fidelity,
            part_id=scan.part_id,
        )

    @property
    def ended(self) -> bool:
        """Whether every recorded pass was replayed."""
        return self._next == len(self._log.passes)

    def feel(self, order: Pass) -> Sweep:
        """Return the samples of the next recorded pass.

        Raises:
            StageError: the recording has another pass next, or has ended.
        """
        if self.ended:
            problem = self._log.problem
            raise StageError(problem or "the recording ends here", "" if problem else "scan the part again")
        recorded = self._log.passes[self._next]
        if not _same(order, recorded.order):
            raise StageError(
                f"the recording continues with another pass than {order.describe()}",
                "read it with the settings of the scan",
            )
        self._next += 1
        return recorded.sweep

    def close(self) -> None:
        """Do nothing: there is no stage to release."""


def _same(one: Pass, other: Pass, *, tolerance: float = 1e-6) -> bool:
    """Whether two passes are equal up to rounding."""
    (ways, numbers), (other_ways, other_numbers) = (
        (
            (p.direction, p.pushed, len(p.line_mm), p.preload_mm is None),
            [*p.line_mm, *p.along_mm, p.sample_pitch_mm, p.speed_mm_s, p.lead_mm, p.preload_mm or 0.0],
        )
        for p in (one, other)
    )
    return ways == other_ways and bool(np.allclose(numbers, other_numbers, rtol=0.0, atol=tolerance))
