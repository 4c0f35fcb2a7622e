"""Result of a study: agreement of serials and decisions, and the gauge study of depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.benchmark.study.agreement import Agreement, agreements
from pipeline.benchmark.study.gauge import GaugeRR, gauge_rr
from pipeline.benchmark.study.repeats import depth_of
from pipeline.benchmark.trials.journal import Trial


@dataclass(frozen=True)
class Study:
    """All results of a study.

    Attributes:
        measured: every trial of the reader.
        answers: of reviewers.
        truth: by part, as far as known.
        serials: how far serials agree, of the reader and the reviewers.
        decisions: how far the reader's decisions agree.
        depth: how well the mean depth of a part is gauged; None where `no_depth` says why.
        no_depth: why there is no gauge study; empty where there is one.
        depths: by part, (appraisers, trials), mm, where all are known.
        depthless: parts left out of the gauge study, as their depth was not known each time.
        notes: what else to know about it, in sentences.
    """

    measured: tuple[Trial, ...]
    answers: tuple[Trial, ...]
    truth: Mapping[str, str]
    serials: tuple[Agreement, ...]
    decisions: tuple[Agreement, ...]
    depth: GaugeRR | None
    no_depth: str
    depths: Mapping[str, list[list[float]]]
    depthless: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def parts(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(dict.fromkeys(m.part for m in self.measured))

    @property
    def appraisers(self) -> tuple[str, ...]:
        """The reader's arrays, then the reviewers."""
        return tuple(self.texts)

    @property
    def widest_depth(self) -> tuple[str, float]:
        """The part whose depth varies most, and from the least to the most, mm; ("", 0) where none is known."""
        spreads = {part: float(np.ptp(depths)) for part, depths in self.depths.items()}
        return max(spreads.items(), key=lambda item: item[1], default=("", 0.0))

    @property
    def texts(self) -> dict[str, dict[str, tuple[str, ...]]]:
        """Texts by appraiser and part, trial by trial."""
        return _by_appraiser((*self.measured, *self.answers), "text")


def study_of(
    measured: Sequence[Trial],
    answers: Sequence[Trial] = (),
    truth: Mapping[str, str] | None = None,
    *,
    notes: tuple[str, ...] = (),
) -> Study:
    """Compute the results from trials, answers and truth.

    Args:
        measured: every trial; equally many of every part and appraiser.
        answers: of reviewers; equally many of every part by each.
        truth: text by part, as far as known.
        notes: what else to know.

    Raises:
        ValueError: not equally many.
    """
    truth = {part: "".join(text.split()) for part, text in (truth or {}).items()}
    depths, depthless = _depths(measured)
    trials = max((m.number for m in measured), default=0)
    no_depth = ""
    if len(depths) < 2:
        no_depth = "the depth of fewer than two parts is known each time"
    elif trials < 2:
        no_depth = "every part was measured once"
    return Study(
        measured=tuple(measured),
        answers=tuple(answers),
        truth=truth,
        serials=tuple(agreements(_by_appraiser((*measured, *answers), "text"), truth)),
        decisions=tuple(agreements(_by_appraiser(measured, "decision"))),
        depth=None if no_depth else gauge_rr(list(depths.values())),
        no_depth=no_depth,
        depths=depths,
        depthless=depthless,
        notes=notes,
    )


def _by_appraiser(measured: Sequence[Trial], attribute: str) -> dict[str, dict[str, tuple[str, ...]]]:
    found: dict[str, dict[str, tuple[str, ...]]] = {}
    for m in measured:
        by_part = found.setdefault(m.mode, {})
        by_part[m.part] = (*by_part.get(m.part, ()), getattr(m, attribute))
    return found


def _depths(measured: Sequence[Trial]) -> tuple[dict[str, list[list[float]]], tuple[str, ...]]:
    """Depths by part, (appraisers, trials), mm, where all are known; and the parts where they are not."""
    found: dict[str, dict[str, list[float]]] = {}
    unknown: dict[str, None] = {}
    for m in measured:
        if (depth_mm := depth_of(m)) is None:
            unknown[m.part] = None
        else:
            found.setdefault(m.part, {}).setdefault(m.mode, []).append(depth_mm)
    known = {part: list(by.values()) for part, by in found.items() if part not in unknown}
    return known, tuple(unknown)
