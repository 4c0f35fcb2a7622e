"""The result of reading a part pass by pass."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

from glyphs.surface.display import OneLine, WordedEnum
from recognition.decide.decision import Decision
from recognition.decide.reading import Reading

if TYPE_CHECKING:  # the service's pages need only the messages
    from recognition.active.moves import Region, Way
    from recognition.decide.evidence import SenseEvidence
    from whisker_array.scan.pass_log import LoggedPass
    from whisker_array.scan.scan import Scan


class StopReason(WordedEnum):
    """Reasons to end touch."""

    SURE = "sure", "the serial is sure"
    NO_GAIN = "no gain", "more touch would not resolve the doubt"
    BUDGET = "budget", "the stage time allowed is used up"
    ALL_FELT = "all felt", "every pass of the plan was felt"
    NOTHING_FOUND = "nothing found", "no characters were felt"
    STAGE_FAILED = "stage failed", "the stage failed; the passes felt before are kept"


@dataclass(frozen=True, eq=False, repr=False)
class ActiveReading(OneLine):
    """The reading of a part, and the steps that led to it: direction, lines per half height, confidence after it."""

    evidence: SenseEvidence
    reading: Reading
    passes: tuple[LoggedPass, ...]
    stop: StopReason
    region_mm: Region
    steps: tuple[tuple[Way, int, float], ...] = ()
    sure_at_look: bool = False
    problem: str = ""

    @property
    def scan(self) -> Scan | None:
        return self.evidence.log.scan

    @property
    def ends_s(self) -> tuple[float, ...]:
        """Stage time up to the end of each pass, s: travel, run-in and turnaround."""
        return tuple(accumulate(felt.order.stage_s for felt in self.passes))

    @property
    def stage_s(self) -> float:
        return self.ends_s[-1] if self.passes else 0.0

    def describe(self) -> str:
        sure = self.reading.decision is Decision.ACCEPT
        problem = f" ({self.problem})" if self.problem else ""
        return (
            f"{self.reading.text or 'nothing'}, {'accepted' if sure else self.reading.decision.value}: "
            f"{len(self.passes)} passes, {self.stage_s:.1f} s of stage time; {self.stop.message}{problem}"
        )


def stage_failure(problem: str, *, passes: int) -> str:
    """Words for a stage that failed before it had felt all that was needed."""
    return f"the stage failed after {passes} {'pass' if passes == 1 else 'passes'}: {problem}"
