"""The result of reading a part pass by pass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from glyphs.surface.display import WordedEnum, one_line
from recognition.decision.decide import Decision
from recognition.decision.reading import Reading

if TYPE_CHECKING:  # the service's pages need the words alone
    from recognition.active.moves import Way
    from whisker_array.scan.scan import Scan
    from whisker_array.whisker.passes import Pass


class StopReason(WordedEnum):
    """Why no further pass was felt."""

    SURE = "sure", "the serial is sure"
    NO_GAIN = "no gain", "more touch would not settle what is in doubt"
    BUDGET = "budget", "the stage time given is spent"
    ALL_FELT = "all felt", "every pass of the plan was felt"
    NOTHING_FOUND = "nothing found", "no characters were felt"
    STAGE_FAILED = "stage failed", "the stage failed; what was felt before is kept"


@dataclass(frozen=True)
class PassFelt:
    """One pass, and the posterior after it.

    Attributes:
        order: the pass.
        stage_s: stage seconds spent up to its end.
        thought_s: processor seconds between its end and the next pass.
        why: what it was chosen for, in words.
        text: what is believed to stand there.
        confidence: that all of it is right; 0 where nothing is believed yet.
    """

    order: Pass
    stage_s: float
    thought_s: float = 0.0
    why: str = ""
    text: str = ""
    confidence: float = 0.0


@dataclass(frozen=True, eq=False)
class ActiveReading:
    """The reading of a part, and the way to it.

    Attributes:
        reading: of all passes together; sent to review where the stage failed.
        passes: in the order in which they were felt.
        stop: why there are no more.
        steps: the way of every step, its lines to half a character's height, and the confidence of the look after it.
        sure_at_look: whether a look asked for the reading that was accepted; otherwise it came when no more was felt.
        problem: what the stage said where it failed; empty otherwise.
        scan: all passes as one scan; None where none was felt.
    """

    reading: Reading
    passes: tuple[PassFelt, ...]
    stop: StopReason
    steps: tuple[tuple[Way, int, float], ...] = ()
    sure_at_look: bool = False
    problem: str = ""
    scan: Scan | None = field(default=None, repr=False)

    __repr__ = one_line

    @property
    def stage_s(self) -> float:
        """Stage seconds spent: travel, run-in and turnaround of every pass."""
        return self.passes[-1].stage_s if self.passes else 0.0

    @property
    def thought_s(self) -> float:
        """The longest time that the stage waited between two passes, processor seconds."""
        return max((p.thought_s for p in self.passes), default=0.0)

    def describe(self) -> str:
        """One line for a person."""
        sure = self.reading.decision is Decision.ACCEPT
        problem = f" ({self.problem})" if self.problem else ""
        return (
            f"{self.reading.text or 'nothing'}, {'accepted' if sure else self.reading.decision.value}: "
            f"{len(self.passes)} passes, {self.stage_s:.1f} s of stage time; {self.stop.message}{problem}"
        )
