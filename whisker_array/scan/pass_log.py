"""Log of a scan that was made pass by pass: the passes in order, and the reason for stopping."""

from __future__ import annotations

import math
from dataclasses import dataclass

from glyphs.ranges import Positive, Validated
from glyphs.surface.display import OneLine
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass
from whisker_array.whisker.sections import WhiskerError


@dataclass(frozen=True, eq=False, repr=False)
class LoggedPass(OneLine):
    """One pass, its samples, its reason in words, and the posterior of the whole text after it."""

    order: Pass
    sweep: Sweep
    why: str = ""
    text: str = ""
    confidence: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class PassLog(OneLine, Validated, error=WhiskerError):
    """The passes of a scan in one stage session, with the reason for stopping, or the stage's message if it failed.
    `field_mm` is (x0, y0, x1, y1) that the array could reach, `region_mm` what was read of it; `other_texts` were more
    likely right than wrong after fewer passes. Raises WhiskerError for an empty log."""

    passes: tuple[LoggedPass, ...]
    array: WhiskerArray
    height_mm: Positive
    field_mm: tuple[float, float, float, float]
    stopped: str = ""
    problem: str = ""
    budget_s: Positive | None = None
    region_mm: tuple[float, float, float, float] | None = None
    other_texts: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not self.passes:
            raise WhiskerError("no pass was run, so there is no log")
        for what, area in (("field", self.field_mm), ("region", self.region_mm or self.field_mm)):
            x0, y0, x1, y1 = area
            if not (x1 > x0 and y1 > y0):
                raise WhiskerError(f"the {what} {area} is empty", hint="give (x0, y0, x1, y1)")
        super().__post_init__()

    @property
    def stage_s(self) -> float:
        return math.fsum(p.order.stage_s for p in self.passes)
