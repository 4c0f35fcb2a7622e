"""The report of a benchmark: one page that needs nothing beside it, a table of all trials, and all figures as JSON.

trials --statistics_of--> Statistics --+--> benchmark.json
   |                                   +--> report.html   (pictures inlined)
   |                                   +--> benchmark.md   (tables for documents)
   +---------------------------------------> benchmark.csv
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.benchmark.analysis.checks import Verdict, verdicts
from pipeline.benchmark.analysis.confusion import characters_right
from pipeline.benchmark.analysis.groups import level_of, levels_in
from pipeline.benchmark.analysis.stability import steady
from pipeline.benchmark.analysis.statistics import Statistics, plain, statistics_of
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.report.page import write_page, write_table, write_text
from pipeline.benchmark.report.report_page import report_values, versions
from pipeline.benchmark.report.text_tables import text_tables
from pipeline.benchmark.report.worst_parts import draw_worst, rank_worst
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark
from pipeline.reading.certificate import Certificate
from pipeline.reading.drift import DriftWatch
from pipeline.workers.executors import Executor, ordered_map
from recognition.decision.evidence import Measure

PAGE, TABLE, FIGURES, DOCUMENT = "report.html", "benchmark.csv", "benchmark.json", "benchmark.md"
_TIMES = ("compute_s", "reading_s", "simulated_s", "scan_s")


@dataclass(frozen=True)
class Written:
    """Files of a report.

    Attributes:
        page: the report.
        table: a line a trial.
        figures: all figures.
        document: the tables that documents show, as Markdown.
        statistics: the figures themselves.
        verdicts: what was to be shown, and whether it was.
        drift: how the parts of each mode differ from the certified ones, in words; of those that do.
    """

    page: Path
    table: Path
    figures: Path
    document: Path
    statistics: Statistics
    verdicts: tuple[Verdict, ...]
    drift: Mapping[str, str] = field(default_factory=dict)


def write_report(
    benchmark: Benchmark,
    trials: Sequence[Trial],
    folder: Path,
    *,
    command: str = "",
    certificate: Certificate | None = None,
    executor: Executor | None = None,
) -> Written:
    """Write the page, the table and the figures.

    Args:
        benchmark: the benchmark.
        trials: trials of all parts and modes, in order.
        folder: output folder.
        command: command line that repeats the run.
        certificate: certificate that the parts were read with, if any.
        executor: executor that draws the worst parts (default: this process).

    Raises:
        FileError: the folder cannot be written.
    """
    found = statistics_of(trials, benchmark.crossed)
    judged = tuple(verdicts(found))
    items = {item.part: item for item in benchmark.parts.items()}
    ranked = [(part, items[part.part]) for part in rank_worst(steady(trials))]
    worst = list(ordered_map(executor or Executor(), partial(draw_worst, benchmark), ranked))
    drift = {} if certificate is None else drift_of(trials, certificate)
    written = Written(
        folder / PAGE, folder / TABLE, folder / FIGURES, folder / DOCUMENT, found, judged, drift
    )
    write_table(written.table, _rows(trials))
    write_text(written.figures, json.dumps(_figures(benchmark, trials, found, judged), indent=1) + "\n")
    write_text(written.document, text_tables(found, command=command))
    values = report_values(benchmark, trials, found, judged, worst)
    write_page(
        written.page, "report.html.j2", **values, command=command, certificate=certificate, drift=drift
    )
    return written


def drift_of(trials: Sequence[Trial], certificate: Certificate) -> dict[str, str]:
    """Describe, for each mode whose parts differ from the certified ones, the difference."""
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
        "characters_right", "lowest_confidence", "lowest_margin", "flags", "error", *_TIMES,
    )  # fmt: skip
    for t in trials:
        levels = ("" if (level := level_of(t, name)) is None else level_name(level) for name in factors)
        yield (
            t.part, *levels, t.mode, t.truth, t.text, int(t.right), t.decision, t.confidence, len(t.truth),
            characters_right(t), min((c.confidence for c in t.characters), default=""),
            min((c.margin for c in t.characters), default=""), t.flags, t.error,
            *(round(getattr(t, name), 4) for name in _TIMES),
        )  # fmt: skip


def _figures(
    benchmark: Benchmark, trials: Sequence[Trial], found: Statistics, judged: Sequence[Verdict]
) -> dict[str, Any]:
    """All figures; what differs from run to run stands under "times" alone."""
    return {
        "benchmark": benchmark.description(),
        "versions": versions(),
        "parts": len({t.part for t in trials}),
        "targets": plain(list(judged)),
        "cells": plain(list(found.cells)),
        "by_severity": plain(list(found.by_severity)),
        "by_mode": plain(list(found.by_mode)),
        "effects": plain(list(found.effects)),
        "comparisons": plain(list(found.comparisons)),
        "knowledge": plain(list(found.knowledge)),
        "stability": plain(list(found.stability)),
        "times": [
            {**plain(g.key), **{f"{name}_median_p95": plain(getattr(g, name)) for name in _TIMES}}
            for g in found.by_severity
        ],
    }


def command_line() -> str:
    """Return the command line as typed."""
    import shlex

    return shlex.join(["tactile-marks", *sys.argv[1:]])
