"""The report of a study: one self-contained page and three tables.

study.html     the whole report
readings.csv   every reading and answer
agreement.csv  every comparison, with its interval and kappa
depth.csv      sources of the variation in depth
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from glyphs.atomic import make_folder
from pipeline.benchmark.report.charts import WIDTH_IN, data_uri, draw_grid
from pipeline.benchmark.report.page import write_page, write_table
from pipeline.benchmark.study.gauge import GaugeRR
from pipeline.benchmark.study.repeats import RECORDED, depth_of
from pipeline.benchmark.study.study import Study

PAGE, READINGS, AGREEMENT, DEPTH = "study.html", "readings.csv", "agreement.csv", "depth.csv"
_MOST_PARTS = 60
"""Most disputed parts that the page shows; the table has all of them."""


def write_study(study: Study, folder: Path) -> tuple[Path, ...]:
    """Write the page and the tables, and return their paths.

    Without a gauge study there is no table of depths.

    Args:
        study: results of the study.
        folder: folder for the files; created if missing.

    Raises:
        FileError: the folder cannot be written.
    """
    make_folder(folder)
    tables = {READINGS: _readings(study), AGREEMENT: _agreement(study)}
    if study.depth is not None:
        tables[DEPTH] = _depth(study.depth)
    for name, rows in tables.items():
        write_table(folder / name, rows)
    differ = disputed_parts(study)
    write_page(
        folder / PAGE,
        "study.html.j2",
        title="Agreement study",
        study=study,
        trials=max((m.number for m in study.measured), default=0),
        comparisons=[("serials", study.serials), ("decisions", study.decisions)],
        gauge=study.depth,
        components=[] if study.depth is None else list(components(study.depth)),
        depths="" if study.depth is None else data_uri(depth_figure(study)),
        differ=[(part, study.truth.get(part, ""), _answers_of(study, part)) for part in differ[:_MOST_PARTS]],
        more=max(0, len(differ) - _MOST_PARTS),
        errors=[m for m in study.measured if m.error],
    )
    return tuple(folder / name for name in (PAGE, *tables))


def disputed_parts(study: Study) -> list[str]:
    """Parts whose serial appraisers read differently from each other or from the truth."""
    disputed = {part for found in study.serials for part in found.disagreed}
    return [part for part in study.parts if part in disputed]


def components(gauge: GaugeRR) -> Iterator[tuple[str, float | None, float | None]]:
    """(source, standard deviation mm, share of the total); None where it cannot be determined."""
    named = {
        "gauge (repeatability and reproducibility)": gauge.gauge_mm,
        "repeatability": gauge.repeatability_mm,
        "reproducibility": gauge.reproducibility_mm,
        "parts": gauge.part_mm,
        "total": gauge.total_mm,
    }
    for source, deviation in named.items():
        yield source, deviation, None if deviation is None else gauge.of_total(deviation)


def depth_figure(study: Study) -> Figure:
    """Mean depth of every part as each appraiser measured it, the shallowest part first."""
    parts = sorted(study.depths.values(), key=np.mean)
    appraisers = list(dict.fromkeys(m.mode for m in study.measured))
    figure = Figure(figsize=(WIDTH_IN, 3.0), layout="constrained")
    axes = figure.subplots()
    for number, who in enumerate(appraisers):
        offset = 0.18 * (number - 0.5 * (len(appraisers) - 1))
        x = [place + offset for place, part in enumerate(parts) for _ in part[number]]
        axes.plot(x, [mm for part in parts for mm in part[number]], ".", markersize=5, label=who)
    axes.set_xticks([])
    axes.set_xlabel("parts, the shallowest first")
    axes.set_ylabel("mean depth, mm")
    draw_grid(axes)
    axes.legend(frameon=False, ncols=4)
    return figure


def _answers_of(study: Study, part: str) -> list[tuple[str, tuple[str, ...]]]:
    return [(who, by_part[part]) for who, by_part in study.texts.items() if part in by_part]


def _readings(study: Study) -> Iterator[Sequence[object]]:
    yield (
        "part", "truth", "appraiser", "trial", "recorded", "text", "right", "decision", "confidence",
        "depth_mean_mm", "error",
    )  # fmt: skip
    for m in (*study.measured, *study.answers):
        truth, depth_mm = study.truth.get(m.part), depth_of(m)
        yield (
            m.part, truth or "", m.mode, m.number, int(bool(m.levels[RECORDED])), m.text,
            "" if truth is None else int(m.text == truth), m.decision,
            m.confidence if m.decision or m.error else "",  # people do not say any
            "" if depth_mm is None else round(depth_mm, 6), m.error,
        )  # fmt: skip


def _agreement(study: Study) -> Iterator[Sequence[object]]:
    yield (
        "attribute", "comparison", "appraisers", "agree", "parts", "share", "low", "high", "kappa", "kappa_low",
        "kappa_high", "disagreed",
    )  # fmt: skip
    for attribute, each in (("serial", study.serials), ("decision", study.decisions)):
        for a in each:
            shares, kappas = (
                ("", "", "") if of is None else (round(of.value, 6), round(of.low, 6), round(of.high, 6))
                for of in (a.parts, a.kappa)
            )
            counts = (a.parts.count, a.parts.total)
            yield attribute, a.kind.value, a.who, *counts, *shares, *kappas, " ".join(a.disagreed)


def _depth(gauge: GaugeRR) -> Iterator[Sequence[object]]:
    yield "source", "standard_deviation_mm", "share_of_total"
    for source, deviation, of_total in components(gauge):
        yield source, *("" if v is None else round(v, 9) for v in (deviation, of_total))
    yield "distinct categories", gauge.categories if gauge.categories is not None else "", ""
