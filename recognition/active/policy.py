"""The choice of the next step, and the rule for stopping when no step is worth its stage time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np

from glyphs.surface.display import OneLine
from recognition.active.active_reading import StopReason
from recognition.active.gain import LOOKS_AHEAD, Gain, fitted_gain
from recognition.active.moves import Region, Step, Way, next_step
from recognition.active.watch import Look
from recognition.decide.evidence import EVEN
from whisker_array.scan.session import Fitting

WORTH_S = 100.0
"""Stage time that one more accepted serial is worth, s: half the time of the whole plan."""


@dataclass(frozen=True, eq=False, repr=False)
class Progress(OneLine):
    """Steps and confidences so far; `steady` is the number of looks before the last with its text, above 0.5."""

    fitting: Fitting
    lines: Mapping[Way, int] = field(default_factory=lambda: MappingProxyType({}))
    stage_s: float = 0.0
    text: str = ""
    confidence: float = 0.0
    steady: int = 0
    confidences: tuple[float, ...] = ()
    steps: tuple[tuple[Way, int], ...] = ()

    def after(self, step: Step, look: Look | None) -> Progress:
        text = "" if look is None else look.text
        return replace(
            self,
            lines=MappingProxyType({**self.lines, step.way: step.lines}),
            stage_s=self.stage_s + step.stage_s,
            text=text,
            confidence=0.0 if look is None else look.confidence,
            steady=self.steady + 1 if text and text == self.text and self.confidence > EVEN else 0,
            confidences=(*self.confidences, 0.0 if look is None else look.confidence),
            steps=(*self.steps, (step.way, step.lines)),
        )

    def with_confidence(self, confidence: float) -> Progress:
        best = max(confidence, self.confidences[-1])
        return replace(self, confidences=(*self.confidences[:-1], best))

    @property
    def history(self) -> tuple[tuple[Way, int, float], ...]:
        """Way of every step, lines of that way after it, and confidence of the look that followed."""
        return tuple(
            (way, lines, sure) for (way, lines), sure in zip(self.steps, self.confidences, strict=True)
        )

    def candidates(self, region_mm: Region, ways: Iterable[Way] = Way) -> list[Step]:
        joins = bool(self.lines)
        steps = [next_step(self.fitting, region_mm, w, self.lines.get(w, 0), joins=joins) for w in ways]
        return [step for step in steps if step is not None]


def first_step(progress: Progress, region_mm: Region) -> Step | StopReason:
    """The first step: along or across, whichever takes less stage time."""
    steps = progress.candidates(region_mm, (Way.ALONG, Way.CROSS))
    return min(steps, key=lambda step: step.stage_s, default=StopReason.ALL_FELT)


class Policy(Protocol):
    """Rule that chooses the steps."""

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        """Return the next step, or the reason to stop."""


@dataclass(frozen=True)
class Ladder:
    """Steps in a fixed order: ways, each with its final number of lines per half character height."""

    rungs: tuple[tuple[Way, int], ...]

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        ways = [way for way, upto in self.rungs if progress.lines.get(way, 0) < upto]
        for step in progress.candidates(region_mm, ways):
            return step if step.stage_s <= left_s or not progress.steps else StopReason.BUDGET
        return StopReason.ALL_FELT


@dataclass(frozen=True)
class Drawn:
    """Steps drawn at random, each direction equally likely, the same for every part; the first is that of `Greedy`."""

    seed: int

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        n = len(progress.steps)
        if n == 0:
            return first_step(progress, region_mm)
        rng = np.random.default_rng((self.seed, n))
        steps = progress.candidates(region_mm, [list(Way)[k] for k in rng.permutation(len(Way))])
        if not steps:
            return StopReason.ALL_FELT
        return steps[0] if steps[0].stage_s <= left_s else StopReason.BUDGET


@dataclass(frozen=True)
class Greedy:
    """Choose the step with the greatest `gain` per stage time; stop if none is worth its time."""

    gain: Gain = field(default_factory=fitted_gain)
    worth_s: float = WORTH_S

    def __post_init__(self) -> None:
        if not self.worth_s > 0.0:
            raise ValueError(f"worth_s is {self.worth_s}; it must be positive")

    def choose(self, progress: Progress, region_mm: Region, *, left_s: float) -> Step | StopReason:
        if not progress.steps:
            return first_step(progress, region_mm)
        steps = progress.candidates(region_mm)
        if not steps:
            return StopReason.ALL_FELT
        cheapest_s = min(step.stage_s for step in steps)
        within = [step for step in steps if step.stage_s <= left_s]
        if not within:
            return StopReason.BUDGET

        def value(step: Step) -> float:
            chance = self.gain.chance(step.way, progress.lines, progress.confidences)
            return chance / (step.stage_s + (LOOKS_AHEAD - 1) * cheapest_s)

        best = max(within, key=value)
        return best if value(best) * self.worth_s >= 1.0 else StopReason.NO_GAIN
