"""All statistics of a benchmark, from its trials; only those of stability count perturbed parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from pipeline.benchmark.analysis.acceptance import RiskAcceptance, acceptance_at_risks
from pipeline.benchmark.analysis.comparisons import (
    Comparison,
    Stability,
    between_givens,
    between_readers,
    stability_of,
    unperturbed,
)
from pipeline.benchmark.analysis.confidence import RiskCoverage
from pipeline.benchmark.analysis.factors import FactorEffect, factor_effects
from pipeline.benchmark.analysis.groups import (
    GIVEN_FACTOR,
    TIMES,
    Group,
    GroupKey,
    edits,
    group_of,
    group_trials,
    level_of,
    levels_in,
    mistakes,
)
from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.shares import Share


@dataclass(frozen=True)
class Headline:
    """Figures of one mode over all dirt; clean parts apart, as in ImageNet-C (Hendrycks and Dietterich 2019)."""

    key: GroupKey
    clean: float | None  # share of characters right of the parts without dirt
    characters: float  # share right, mean over the severities of dirt, as those of serials and parts accepted
    serials: float
    accepted: float
    relative_error: float | None  # edits over those of the baseline reader, mean over soils (the mCE there)


def headlines_of(
    by_mode: Mapping[GroupKey, Sequence[Trial]], by_severity: Sequence[Group], *, baseline: str
) -> Iterator[Headline]:
    """Compute the headline of every mode that read dirty parts; errors are relative to those of the baseline mode."""
    edits_by_soil: dict[GroupKey, Counter[Level]] = {key: Counter() for key in by_mode}
    for key, trials in by_mode.items():
        for trial in trials:
            edits_by_soil[key][level_of(trial, "soil")] += edits(trial) if trial.severity else 0
    for key, by_soil in edits_by_soil.items():
        groups = [g for g in by_severity if GroupKey(g.key.mode, g.key.levels[1:]) == key]
        dirty = [g for g in groups if g.key.severity]
        base = edits_by_soil.get(GroupKey(baseline, key.levels), Counter[Level]())
        ratios = [by_soil[soil] / count for soil, count in base.items() if count]
        if dirty:
            yield Headline(
                key=key,
                clean=next((g.characters.value for g in groups if g.key.severity == 0.0), None),
                characters=float(np.mean([g.characters.value for g in dirty])),
                serials=float(np.mean([g.serials.value for g in dirty])),
                accepted=float(np.mean([g.accepted.value for g in dirty])),
                relative_error=float(np.mean(ratios)) if ratios else None,
            )


@dataclass(frozen=True, eq=False)
class Statistics:
    """All statistics. If readers were given several sets of facts, each group has one set; effects mix them."""

    levels: dict[str, tuple[Level, ...]]
    given: tuple[str, ...]
    crossed: tuple[str, ...]  # factors that make up the cells
    cells: tuple[Group, ...]  # one for each combination of mode, crossed factors and given facts
    by_severity: tuple[Group, ...]
    by_mode: tuple[Group, ...]
    headlines: tuple[Headline, ...]
    effects: tuple[FactorEffect, ...]
    comparisons: tuple[Comparison, ...]  # readers on the same parts: over all parts, then at every severity
    knowledge: tuple[Comparison, ...]  # each reader and itself when it knew fewer facts
    stability: tuple[Stability, ...]
    # what each mode accepts at a risk, with a threshold fitted to other soils
    at_risk: tuple[RiskAcceptance, ...]


def statistics_of(
    all_trials: Sequence[Trial],
    crossed: Sequence[str] = ("severity",),
    *,
    risks: Sequence[float] = (0.01, 0.001),
    baseline: str = "rapidocr photo",
) -> Statistics:
    """Statistics of the trials of all parts and modes; errors are relative to those of the baseline."""
    trials = unperturbed(all_trials)
    facts = tuple(dict.fromkeys(t.given for t in trials))
    more = (GIVEN_FACTOR,) if len(facts) > 1 else ()
    by_severity = group_trials(trials, ("severity", *more))
    at_severity = tuple(group_of(key, group) for key, group in by_severity.items())
    by_mode = group_trials(trials, more)
    levels = levels_in(trials)
    over_all = by_mode if len(levels.get("severity", ())) > 1 else {}
    return Statistics(
        levels=levels,
        given=facts,
        crossed=tuple(crossed),
        cells=tuple(group_of(key, cell) for key, cell in group_trials(trials, (*crossed, *more)).items()),
        by_severity=at_severity,
        by_mode=tuple(group_of(key, group) for key, group in by_mode.items()),
        headlines=tuple(headlines_of(by_mode, at_severity, baseline=baseline)),
        effects=factor_effects(trials),
        comparisons=(*between_readers(over_all), *between_readers(by_severity)),
        knowledge=tuple(between_givens(trials)),
        stability=stability_of(all_trials),
        at_risk=tuple(acceptance_at_risks(by_mode.items(), risks)),
    )


def plain(value: Any) -> Any:
    """Convert statistics to JSON values with six decimals; times are left out, as they differ from run to run."""
    match value:
        case Group():
            fields = {name: item for name, item in vars(value).items() if name not in _NOT_PLAIN}
            return {**plain(value.key), **plain(fields), "mistakes": mistakes(value.confused)}
        case GroupKey():
            return {"mode": value.mode, **dict(value.levels)}
        case Share():
            return plain({**vars(value), "share": value.value})
        case RiskCoverage():
            step = max(1, value.coverage.size // _CURVE_POINTS)
            curve = np.stack([value.coverage, value.risk], axis=1)[::-1][::step][::-1]
            return plain({"aurc": value.area, "least_aurc": value.least_area, "curve": curve.tolist()})
        case Enum():
            return plain(value.value)
        case float():
            return round(value, 6)
        case dict():
            return {k: plain(v) for k, v in value.items()}
        case list() | tuple():
            return [plain(v) for v in value]
    return plain(vars(value)) if is_dataclass(value) else value


def plain_times(group: Group) -> dict[str, Any]:
    """Convert the times of a group to JSON values."""
    return {**plain(group.key), **{f"{name}_median_p95": plain(group.seconds[name]) for name in TIMES}}


_CURVE_POINTS = 100  # longer risk-coverage curves are thinned to between 100 and 200 points
_NOT_PLAIN = ("key", "confused", "seconds", "stage_s")
