"""Report of a benchmark: one self-contained page, a table of all trials, and all figures as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.benchmark.analysis.comparisons import unperturbed
from pipeline.benchmark.analysis.groups import (
    GIVEN_FACTOR,
    TIMES,
    Group,
    characters_right,
    level_of,
    levels_in,
    mistakes,
)
from pipeline.benchmark.analysis.statistics import Statistics, plain, plain_times, statistics_of
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.readers.modes import EXPERTS, PEERS
from pipeline.benchmark.readers.peers import ACCEPTED_FROM
from pipeline.benchmark.report.charts import (
    accuracy_figure,
    data_uri,
    leading_mode,
    modes_in,
    reliability_figure,
    risk_figure,
    severities_in,
)
from pipeline.benchmark.report.page import render, versions, write_files
from pipeline.benchmark.report.worst_parts import draw_worst, rank_worst
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark
from pipeline.common.accepted_risk import parts_needed
from pipeline.common.shares import CONFIDENCE_LEVEL
from pipeline.reading.certificate import Certificate
from pipeline.reading.drift import DriftWatch
from pipeline.workers.executors import Executor, ordered_map
from recognition.decide.score import Measure

PAGE, DOCUMENT, TABLE, FIGURES = "report.html", "benchmark.md", "benchmark.csv", "benchmark.json"


def write_report(
    benchmark: Benchmark, trials: Sequence[Trial], folder: Path, *, certificate: Certificate | None = None,
    executor: Executor | None = None,
) -> tuple[str, tuple[Path, ...], Statistics]:  # fmt: skip
    """Write page, tables and figures. Returns the tables in Markdown, the paths, and the figures. Raises FileError."""
    statistics = statistics_of(trials, benchmark.crossed)
    items = {item.part: item for item in benchmark.parts.items()}
    ranked = [(part, items[part.part]) for part in rank_worst(unperturbed(trials))]
    worst = list(ordered_map(executor or Executor(), partial(draw_worst, benchmark), ranked))
    drift = {} if certificate is None else drift_of(trials, certificate)
    array = benchmark.reading.array
    felt = [f"{array.sensors.value} sensors"]
    felt += [array.whisker.whisker] if array.whisker else []
    felt += [f"{array.speed_mm_s:g} mm/s"] if array.speed_mm_s else []
    document = document_of(statistics, drift, touch=", ".join(felt))
    values = _values(benchmark, trials, statistics) | {
        "worst": worst,
        "certificate": certificate,
        "drift": drift,
    }
    contents = {
        PAGE: render("report.html.j2", **values),
        DOCUMENT: document,
        TABLE: _rows(trials),
        FIGURES: _figures(benchmark, trials, statistics),
    }
    return document, write_files(folder, contents), statistics


def document_of(statistics: Statistics, drift: Mapping[str, str] | None = None, *, touch: str = "") -> str:
    """The tables in Markdown, with how a mode's parts differ from the certified ones, and the array that felt them."""
    return render("benchmark.md.j2", **_tables(statistics), drift=drift or {}, touch=touch)


def drift_of(trials: Sequence[Trial], certificate: Certificate) -> dict[str, str]:
    """Describe how the parts differ from the certified ones, for each mode for which they do."""
    watches: dict[str, DriftWatch] = {}
    for trial in (t for t in trials if not t.perturbed):
        measures = {m: trial.measures[m.value] for m in Measure if m.value in trial.measures}
        watches.setdefault(trial.mode, DriftWatch(certificate)).add(trial.mode, measures)
    for watch in watches.values():
        watch.compare()
    return {mode: watch.first for mode, watch in watches.items() if watch.first}


def _rows(trials: Sequence[Trial]) -> Iterator[Sequence[object]]:
    factors = list(levels_in(trials))
    yield (
        "part", *factors, "mode", "truth", "text", "right", "decision", "confidence", "characters",
        "characters_right", "lowest_confidence", "lowest_margin", "flags", "error", *TIMES,
    )  # fmt: skip
    for t in trials:
        levels = ("" if (level := level_of(t, name)) is None else level_name(level) for name in factors)
        yield (
            t.part, *levels, t.mode, t.truth, t.text, int(t.right), t.decision, t.confidence, len(t.truth),
            characters_right(t), min((c.confidence for c in t.characters), default=""),
            min((c.margin for c in t.characters), default=""), t.flags, t.error,
            *(round(getattr(t, name), 4) for name in TIMES),
        )  # fmt: skip


def _figures(benchmark: Benchmark, trials: Sequence[Trial], statistics: Statistics) -> dict[str, Any]:
    names = (
        "cells", "by_severity", "by_mode", "headlines", "effects", "comparisons", "knowledge", "stability",
        "at_risk",
    )  # fmt: skip
    return {
        "benchmark": benchmark.description(),
        "versions": versions(),
        "parts": len({t.part for t in trials}),
        **{name: plain(getattr(statistics, name)) for name in names},
        "times": [plain_times(group) for group in statistics.by_severity],
    }


def _tables(statistics: Statistics) -> dict[str, Any]:
    modes = modes_in(statistics.by_mode)
    return {
        "modes": modes,
        "statistics": statistics,
        "leaders": sorted(statistics.by_mode, key=lambda g: (g.character_error_rate, -g.accepted.value)),
        "lead": leading_mode(modes),
        "summary": _sort_groups(statistics.by_severity),
        "severities": severities_in(statistics.by_severity),
    }


def _values(benchmark: Benchmark, trials: Sequence[Trial], statistics: Statistics) -> dict[str, Any]:
    tables, description = _tables(statistics), benchmark.description()
    modes = tables["modes"]
    # charts show the first set of facts only: more lines would hide each other
    by_severity, by_mode = (
        [g for g in groups if g.key.level(GIVEN_FACTOR) in (None, statistics.given[0])]
        for groups in (statistics.by_severity, statistics.by_mode)
    )
    pictures = {
        "accuracy": accuracy_figure(by_severity),
        "risk": risk_figure(by_severity),
        "reliability": reliability_figure(by_mode),
    }
    return {
        **tables,
        "title": "Benchmark of reading dirty marks",
        "n_parts": len({t.part for t in trials}),
        "design": description["parts"],
        "effects": {(e.mode, e.factor): e for e in statistics.effects},
        "cells": None if set(statistics.crossed) <= {"severity"} else _cells(statistics.cells),
        "wrong": _sort_groups(statistics.by_mode),
        "accept_risk": (risk := benchmark.accept_risk),
        "wrong_needs": parts_needed(risk, confidence=CONFIDENCE_LEVEL),
        "experts": [m for m in modes if m in EXPERTS],
        "peers": [m for m in modes if m in PEERS],
        "peer_accepts": ACCEPTED_FROM,
        "pictures": {name: data_uri(figure) for name, figure in pictures.items()},
        "confusions": [(g.key.mode, mistakes(g.confused)) for g in _sort_groups(by_mode)],
        "errors": [t for t in trials if t.error],
        "settings": list(_flat(description)),
    }


def _cells(cells: Sequence[Group]) -> dict[Any, dict[str, Group]]:
    by_levels: dict[Any, dict[str, Group]] = {}
    for cell in cells:
        by_levels.setdefault(cell.key.levels, {})[cell.key.mode] = cell
    return by_levels


def _sort_groups(groups: Sequence[Group]) -> list[Group]:
    modes, severities = modes_in(groups), severities_in(groups)
    return sorted(groups, key=lambda g: (severities.index(g.key.severity), modes.index(g.key.mode)))


def _flat(values: dict[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", ", ".join(map(str, value)) if isinstance(value, list) else str(value)
