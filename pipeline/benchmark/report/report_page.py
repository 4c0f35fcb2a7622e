"""The page of a benchmark's report: what was found, laid out; the factors first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any

from pipeline.benchmark.analysis.bounds import parts_without_wrong
from pipeline.benchmark.analysis.checks import WRONG_LIMIT, Verdict, at_most
from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, Group
from pipeline.benchmark.analysis.statistics import Statistics
from pipeline.benchmark.readers.modes import EXPERTS, PEERS
from pipeline.benchmark.readers.peers import ACCEPTED_FROM
from pipeline.benchmark.report import charts as report_pictures
from pipeline.benchmark.report import curves as report_curves
from pipeline.benchmark.report.charts import inlined, leading, modes_in, severities_in
from pipeline.benchmark.report.design_words import design_words
from pipeline.benchmark.report.page import bars
from pipeline.benchmark.report.text_tables import given_words, leaders
from pipeline.benchmark.report.worst_parts import WorstPart, marked
from pipeline.benchmark.trials.journal import Trial
from pipeline.benchmark.trials.run import Benchmark
from pipeline.common.version import library_versions

_MOST_MISTAKES = 12


def report_values(
    benchmark: Benchmark,
    trials: Sequence[Trial],
    found: Statistics,
    judged: Sequence[Verdict],
    worst: Sequence[WorstPart],
) -> dict[str, Any]:
    """Values of the page by their names in the template.

    Args:
        benchmark: what was tried.
        trials: of all parts and modes, in order.
        found: of these trials.
        judged: of these findings.
        worst: parts to be shown.
    """
    description, errors = benchmark.description(), [t for t in trials if t.error]
    modes, n_parts = modes_in(found.by_mode), len({t.part for t in trials})
    first = [g for g in found.by_mode if g.key.level(GIVEN_FACTOR) in (None, found.given[0])]
    return {
        "title": "Benchmark of reading dirty marks",
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "n_parts": n_parts,
        "modes": modes,
        "design": design_words(description["parts"], n_parts, found.given),
        "given": found.given,
        "given_words": given_words(found.given),
        "leaders": leaders(found.by_mode),
        "lead": leading(modes),
        "factors": list(_factors(found, modes)),
        "knowledge": found.knowledge,
        "stability": found.stability,
        "cells": _cells(found),
        "wrong": [(g, *at_most(g.wrong_of_accepted, WRONG_LIMIT)) for g in _sorted(found.by_mode)],
        "wrong_limit": WRONG_LIMIT,
        "wrong_needs": parts_without_wrong(WRONG_LIMIT),
        "experts": [m for m in modes if m in EXPERTS],
        "peers": [m for m in modes if m in PEERS],
        "peer_accepts": ACCEPTED_FROM,
        "verdicts": judged,
        "summary": _sorted(found.by_severity),
        "comparisons": found.comparisons,
        "pictures": _pictures(found),
        "confusions": list(_confusions(first)),
        "worst": [(part, [(t, marked(t)) for t in part.trials]) for part in worst],
        "errors": errors[:20],
        "n_errors": len(errors),
        "settings": list(_flat(description)),
        "versions": versions(),
    }


def _factors(found: Statistics, modes: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Every factor: its levels for the leading reader with bars, and for all readers."""
    lead = leading(modes)
    for effect in (e for e in found.effects if e.mode == lead):
        others = {e.mode: e for e in found.effects if e.factor == effect.factor}
        by_level = {mode: {level.level: level for level in e.levels} for mode, e in others.items()}
        foot, rows = bars(effect)
        yield {
            "effect": effect,
            "foot": foot,
            "bars": rows,
            "modes": [mode for mode in modes if mode in others],
            "table": [
                (e.level, [by_level[mode].get(e.level) for mode in modes if mode in others])
                for e in effect.levels
            ],
        }


def _cells(found: Statistics) -> dict[str, Any] | None:
    """The cells in a table, a column a mode; None where they are those of the severities."""
    if set(found.crossed) <= {"severity"}:
        return None
    modes = modes_in(found.cells)
    rows = dict.fromkeys(cell.key.levels for cell in found.cells)
    at = {(cell.key.levels, cell.key.mode): cell for cell in found.cells}
    names = [name for name, _ in next(iter(rows))]
    kept = [k for k, name in enumerate(names) if len({levels[k][1] for levels in rows}) > 1]
    return {
        "factors": [names[k] for k in kept],
        "modes": modes,
        "rows": [
            ([levels[k][1] for k in kept], [at.get((levels, mode)) for mode in modes]) for levels in rows
        ],
    }


def _sorted(groups: Sequence[Group]) -> list[Group]:
    modes, severities = modes_in(groups), severities_in(groups)
    return sorted(groups, key=lambda g: (severities.index(g.key.severity), modes.index(g.key.mode)))


def _pictures(found: Statistics) -> dict[str, str]:
    """Draw the charts for the first knowledge given; more lines would hide each other."""
    by_severity, by_mode = (
        [g for g in groups if g.key.level(GIVEN_FACTOR) in (None, found.given[0])]
        for groups in (found.by_severity, found.by_mode)
    )
    return {
        "accuracy": inlined(report_pictures.accuracy_figure(by_severity)),
        "split": inlined(report_pictures.split_figure(by_severity)),
        "risk": inlined(report_curves.risk_figure(by_severity)),
        "reliability": inlined(report_curves.reliability_figure(by_mode)),
    }


def _confusions(groups: Sequence[Group]) -> Iterator[tuple[str, str, list[tuple[str, str, int]], int]]:
    """(mode, picture, most frequent mistakes, how many in all); peers without a picture."""
    for mode in modes_in(groups):
        group = next(g for g in groups if g.key.mode == mode)
        mistakes = group.confused.mistakes()
        total = sum(n for *_, n in mistakes)
        picture = ""
        if (
            mode not in {*EXPERTS, *PEERS} and group.confused.counts.size
        ):  # there is none where every part failed
            title = f"{mode}: {total} mistakes in {group.characters.total} characters"
            picture = inlined(report_curves.confusion_figure(group.confused, title))
        yield mode, picture, mistakes[:_MOST_MISTAKES], total


def _flat(values: dict[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def versions() -> dict[str, str]:
    """Versions of this program and of the libraries below it."""
    names = (
        "numpy scipy numba opencv-python-headless scikit-image scikit-learn rapidocr onnxruntime tesserocr"
    )
    return library_versions(("tactile-marks", *names.split()))
