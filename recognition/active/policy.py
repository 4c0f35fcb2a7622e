"""Which step comes next, and when no more is worth its stage time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol

from glyphs.surface.display import one_line
from recognition.active.active_reading import StopReason
from recognition.active.moves import Region, Step, Way, next_step
from recognition.active.watch import Look
from whisker_array.scan.session import Fitting


@dataclass(frozen=True, eq=False)
class Progress:
    """What was felt and believed so far.

    Attributes:
        fitting: of the stage.
        lines: of each way that was felt, to a whisker's pitch.
        stage_s: spent.
        doubts_nats: entropy after each look; NaN where there was no line.
        text: of the last look.
        confidence: of the last look; 0 without one.
        unchanged: looks before the last one that said the same.
        steps: ways of the steps, in order.
    """

    fitting: Fitting
    lines: Mapping[Way, int] = field(default_factory=lambda: MappingProxyType({}))
    stage_s: float = 0.0
    doubts_nats: tuple[float, ...] = ()
    text: str = ""
    confidence: float = 0.0
    unchanged: int = 0
    steps: tuple[Way, ...] = ()

    __repr__ = one_line

    def after(self, step: Step, look: Look | None) -> Progress:
        """The progress after a step and the look that followed."""
        text = "" if look is None else look.text
        return replace(
            self,
            lines=MappingProxyType({**self.lines, step.way: step.lines}),
            stage_s=self.stage_s + step.stage_s,
            doubts_nats=(*self.doubts_nats, float("nan") if look is None else look.doubt_nats),
            text=text,
            confidence=0.0 if look is None else look.confidence,
            unchanged=self.unchanged + 1 if text and text == self.text else 0,
            steps=(*self.steps, step.way),
        )

    def step(self, way: Way, region_mm: Region) -> Step | None:
        """The next step of a way."""
        return next_step(self.fitting, region_mm, way, self.lines.get(way, 0))


class Policy(Protocol):
    """Chooses steps."""

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        """The next step, or why there is none.

        Args:
            progress: so far.
            region_mm: where the line lies.
            left_s: of the budget, stage seconds.
        """


@dataclass(frozen=True)
class Ladder:
    """Steps in a fixed order.

    Attributes:
        rungs: ways, and lines to a whisker's pitch that each is brought to, in order.
    """

    rungs: tuple[tuple[Way, int], ...]

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        """See `Policy`."""
        for way, upto in self.rungs:
            if progress.lines.get(way, 0) < upto:
                step = progress.step(way, region_mm)
                if step is not None:
                    return step if step.stage_s <= left_s or not progress.steps else StopReason.BUDGET
        return StopReason.ALL_FELT


LADDER = Ladder(
    (
        (Way.ALONG, 8),
        (Way.CROSS, 6),
        (Way.BACK, 6),
        (Way.ALONG, 12),
        (Way.CROSS, 12),
        (Way.BACK, 12),
        (Way.ALONG, 16),
    )
)
