"""Result of a study: agreement of serials and decisions, and the gauge study of depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.benchmark.study.agreement import Agreement, agreements
from pipeline.benchmark.study.gauge import GaugeRR, gauge_rr
from pipeline.benchmark.study.repeats import depth_of
from pipeline.benchmark.trials.journal import Trial


@dataclass(frozen=True)
class Study:
    """Results of a study: trials of the reader, answers of reviewers (equally many, or ValueError), truth, notes."""

    measured: tuple[Trial, ...]
    answers: tuple[Trial, ...] = ()
    truth: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def serials(self) -> list[Agreement]:
        return agreements(self.texts, self.truth)

    @cached_property
    def decisions(self) -> list[Agreement]:
        return agreements(_by_appraiser(self.measured, "decision"))

    @cached_property
    def depths(self) -> dict[str, list[list[float]]]:
        """Depths by part, (appraisers, trials), mm, of parts whose depth is known in every trial."""
        depths: dict[str, dict[str, list[float]]] = {}
        for m in self.measured:
            if m.part not in self.depthless and (depth_mm := depth_of(m)) is not None:
                depths.setdefault(m.part, {}).setdefault(m.mode, []).append(depth_mm)
        return {part: list(by.values()) for part, by in depths.items()}

    @cached_property
    def depthless(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(m.part for m in self.measured if depth_of(m) is None))

    @property
    def no_depth(self) -> str:
        if len(self.depths) < 2:
            return "the depth of fewer than two parts is known in every trial"
        return "every part was measured once" if max(m.number for m in self.measured) < 2 else ""

    @cached_property
    def depth(self) -> GaugeRR | None:
        return None if self.no_depth else gauge_rr(list(self.depths.values()))

    @property
    def parts(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(m.part for m in self.measured))

    @property
    def appraisers(self) -> tuple[str, ...]:
        return tuple(self.texts)

    @property
    def widest_depth(self) -> tuple[str, float]:
        """The part whose depth varies most, and the range of its depth, mm; ("", 0) if none is known."""
        spreads = {part: float(np.ptp(depths)) for part, depths in self.depths.items()}
        return max(spreads.items(), key=lambda item: item[1], default=("", 0.0))

    @property
    def texts(self) -> dict[str, dict[str, tuple[str, ...]]]:
        return _by_appraiser((*self.measured, *self.answers), "text")


def _by_appraiser(measured: Sequence[Trial], attribute: str) -> dict[str, dict[str, tuple[str, ...]]]:
    values: dict[str, dict[str, tuple[str, ...]]] = {}
    for m in measured:
        by_part = values.setdefault(m.mode, {})
        by_part[m.part] = (*by_part.get(m.part, ()), getattr(m, attribute))
    return values
