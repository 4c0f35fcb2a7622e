"""Write the report of a study: study.html, its tables as study.md, study.json, and every reading in readings.csv."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pipeline.benchmark.analysis.statistics import plain
from pipeline.benchmark.report.charts import WIDTH_IN, data_uri
from pipeline.benchmark.report.page import render, write_files
from pipeline.benchmark.study.gauge import GaugeRR
from pipeline.benchmark.study.repeats import RECORDED, depth_of
from pipeline.benchmark.study.study import Study
from pipeline.plots.pictures import styled

PAGE, DOCUMENT, FIGURES, READINGS = "study.html", "study.md", "study.json", "readings.csv"
# disputed parts that the page shows; the table has all of them
_MOST_PARTS = 60


def write_study(study: Study, folder: Path) -> tuple[str, tuple[Path, ...]]:
    """Write page, tables and figures; return the tables in Markdown and all paths. Raises FileError: it cannot."""
    sources = [] if study.depth is None else list(components(study.depth))
    values = {
        "study": study,
        "comparisons": [("serials", study.serials), ("decisions", study.decisions)],
        "gauge": study.depth,
        "components": sources,
        "errors": [m for m in study.measured if m.error],
    }
    document = render("study.md.j2", **values)
    figures = plain(
        {"serials": study.serials, "decisions": study.decisions, "depth": study.depth, "sources": sources}
    )
    differ = _disputed_parts(study)
    page = render(
        "study.html.j2",
        **values,
        title="Agreement study",
        trials=max((m.number for m in study.measured), default=0),
        depths="" if study.depth is None else data_uri(_depth_figure(study)),
        differ=[(part, study.truth.get(part, ""), _answers_of(study, part)) for part in differ[:_MOST_PARTS]],
        more=max(0, len(differ) - _MOST_PARTS),
    )
    contents = {PAGE: page, DOCUMENT: document, FIGURES: figures, READINGS: _readings(study)}
    return document, write_files(folder, contents)


def _disputed_parts(study: Study) -> list[str]:
    disputed = {part for agreement in study.serials for part in agreement.disagreed}
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


@styled
def _depth_figure(study: Study) -> Figure:
    parts = sorted(study.depths.values(), key=np.mean)
    appraisers = list(dict.fromkeys(m.mode for m in study.measured))
    figure = Figure(figsize=(WIDTH_IN, 3.0))
    axes = figure.subplots()
    for number, who in enumerate(appraisers):
        offset = 0.18 * (number - 0.5 * (len(appraisers) - 1))
        x = [place + offset for place, part in enumerate(parts) for _ in part[number]]
        axes.plot(x, [mm for part in parts for mm in part[number]], ".", markersize=5, label=who)
    axes.set_xticks([])
    axes.set_xlabel("parts, the shallowest first")
    axes.set_ylabel("mean depth, mm")
    axes.grid()
    axes.legend(ncols=4)
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
            m.confidence if m.decision or m.error else "",  # people state none
            "" if depth_mm is None else round(depth_mm, 6), m.error,
        )  # fmt: skip
